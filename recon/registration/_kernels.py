"""The loops of the registration, compiled."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.intermediate import ZBuffer
from denseface.recon.numerics.jit import compiled

_HIDDEN_MM, _HIDDEN_SHARE = np.float32(15.0), np.float32(0.02)
"""A point behind the z-buffer by more than this, mm or by its z (the larger counts), is hidden.
Neighbouring cells of a steep surface differ by a few millimetres."""


class ColorCamera(NamedTuple):
    """The colour camera and its pose: X_color = rotation @ X_depth + translation."""

    rotation: tuple[float, ...]
    """9 numbers, row by row."""
    translation: tuple[float, ...]
    """mm."""
    size: tuple[float, float]
    """Width and height, pixels."""
    intrinsics: tuple[float, ...]
    """fx, fy, cx, cy, pixels."""
    distortion: tuple[float, ...]
    """k1, k2, p1, p2, k3."""


class PixelGrid(NamedTuple):
    """Every k-th pixel of a part of the depth image."""

    x: Doubles
    y: Doubles
    """(rows, columns) of the whole image: each pixel's ray at z = 1."""
    begin: tuple[int, int]
    step: tuple[int, int]
    """Row and column."""


class Projected(NamedTuple):
    """Points and where the colour camera sees them."""

    points: Floats
    """(H, W, 3), mm, depth camera frame."""
    pixels: Floats
    """(H, W, 2), (u, v) in the colour image."""
    color_depth: Floats
    """(H, W), mm, z in the colour camera's frame."""


@compiled
def project(
    depth: NDArray[np.uint16], unit_and_offset_mm: tuple[float, float], grid: PixelGrid,
    camera: ColorCamera, out: Projected, z_buffer: ZBuffer,
) -> tuple[int, int, int, int]:
    """Back-project each measured depth by Eq. (1) and project it into the colour image.

    depth : (H, W), counts, the pixels of `grid`; 0 where nothing was measured
    unit_and_offset_mm : mm of a count, and what is added to each depth
    out : written where there is a depth; pixels and z only before the colour camera
    z_buffer : lowered to the points inside the colour image

    Gives the top, bottom, left and right cells that were lowered; (rows, -1, columns, -1) for none.
    """
    points, pixels, color_depth = out
    nearest, per_cell = z_buffer.nearest, np.float32(1) / np.float32(z_buffer.pitch)
    unit, offset = np.float32(unit_and_offset_mm[0]), np.float32(unit_and_offset_mm[1])
    columns = depth.shape[1]
    ray_x, ray_y = np.empty(columns), np.empty(columns)
    px, py, pz = (np.empty(columns, np.float32), np.empty(columns, np.float32),
                  np.empty(columns, np.float32))
    us, vs, zs = (np.empty(columns, np.float32), np.empty(columns, np.float32),
                  np.empty(columns, np.float32))
    top, bottom, left, right = nearest.shape[0], -1, nearest.shape[1], -1
    for i in range(depth.shape[0]):
        for j in range(columns):
            row, column = grid.begin[0] + i * grid.step[0], grid.begin[1] + j * grid.step[1]
            ray_x[j], ray_y[j] = grid.x[row, column], grid.y[row, column]
        line = depth[i]
        # Vectorised over the whole row, measured or not: faster than a branch for each pixel.
        for j in range(columns):
            z = np.float32(line[j]) * unit + offset
            px[j], py[j], pz[j] = np.float32(ray_x[j] * z), np.float32(ray_y[j] * z), z
            us[j], vs[j], zs[j] = _to_color_image(px[j], py[j], z, camera)
        for j in range(columns):
            if line[j] == 0:
                continue
            points[i, j, 0], points[i, j, 1], points[i, j, 2] = px[j], py[j], pz[j]
            u, v, z = us[j], vs[j], zs[j]
            if z <= 0:
                continue
            pixels[i, j, 0], pixels[i, j, 1] = u, v
            color_depth[i, j] = z
            if _inside(u, v, camera.size):
                row, column = _cell(u, v, per_cell)
                nearest[row, column] = min(nearest[row, column], z)
                top, bottom = min(top, row), max(bottom, row)
                left, right = min(left, column), max(right, column)
    return top, bottom, left, right


@compiled
def project_points(out: Projected, camera: ColorCamera) -> None:
    """Project the points of `out` into the colour image.

    out : of shape (1, n); pixels and z are written, z is 0 behind the camera
    """
    points, pixels, color_depth = out
    for i in range(points.shape[1]):
        u, v, z = _to_color_image(points[0, i, 0], points[0, i, 1], points[0, i, 2], camera)
        pixels[0, i, 0], pixels[0, i, 1] = u, v
        color_depth[0, i] = z if z > 0 else 0.0


@compiled
def _to_color_image(
    x0: np.float32, y0: np.float32, z0: np.float32, camera: ColorCamera
) -> tuple[np.floating, np.floating, np.floating]:
    """Give u, v and z of a point in the colour camera; u and v only mean something where z > 0.

    Pinhole with Brown-Conrady distortion, as in `CameraModel.project`.
    """
    r, t = camera.rotation, camera.translation
    fx, fy, cx, cy = camera.intrinsics
    k1, k2, p1, p2, k3 = camera.distortion
    z = r[6] * x0 + r[7] * y0 + r[8] * z0 + t[2]
    inverse = 1 / (z if z > 0 else 1.0)
    x = (r[0] * x0 + r[1] * y0 + r[2] * z0 + t[0]) * inverse
    y = (r[3] * x0 + r[4] * y0 + r[5] * z0 + t[1]) * inverse
    r2 = x * x + y * y
    radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
    return (fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx,
            fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy, z)


@compiled
def visible_mask(
    pixels: Floats, color_depth: Floats, z_buffer: ZBuffer, size: tuple[float, float]
) -> Bools:
    """Give (H, W): which points lie inside an image of that width and height and are not hidden.

    z_buffer : each cell lowered to the least of the cells around it
    """
    visible = np.zeros(color_depth.shape, np.bool_)
    nearest, per_cell = z_buffer.nearest, np.float32(1) / np.float32(z_buffer.pitch)
    for i in range(color_depth.shape[0]):
        for j in range(color_depth.shape[1]):
            z = color_depth[i, j]
            if z <= 0:
                continue
            u, v = pixels[i, j, 0], pixels[i, j, 1]
            if _inside(u, v, size):
                row, column = _cell(u, v, per_cell)
                visible[i, j] = z <= nearest[row, column] + max(_HIDDEN_MM, _HIDDEN_SHARE * z)
    return visible


@compiled
def sample_image(pixels: Floats, visible: Bools, image: Bytes) -> Bytes:
    """Give the colours of the visible points, bilinear: (H, W, 3), zero for the others."""
    height, width = image.shape[:2]
    colors = np.zeros((*visible.shape, 3), np.uint8)
    for i in range(visible.shape[0]):
        for j in range(visible.shape[1]):
            if not visible[i, j]:
                continue
            u = min(max(pixels[i, j, 0], np.float32(0)), np.float32(width - 1))
            v = min(max(pixels[i, j, 1], np.float32(0)), np.float32(height - 1))
            left, top = np.uint32(u), np.uint32(v)
            right = min(left + 1, np.uint32(width - 1))
            bottom = min(top + 1, np.uint32(height - 1))
            du, dv = u - np.float32(left), v - np.float32(top)
            for c in range(3):
                upper_left = np.float32(image[top, left, c])
                lower_left = np.float32(image[bottom, left, c])
                upper = upper_left + du * (np.float32(image[top, right, c]) - upper_left)
                lower = lower_left + du * (np.float32(image[bottom, right, c]) - lower_left)
                colors[i, j, c] = np.uint8(np.int32(
                    upper + dv * (lower - upper) + np.float32(0.5)))
    return colors


@compiled
def _inside(u: np.float32, v: np.float32, size: tuple[float, float]) -> bool:
    return bool(u > -0.5 and u < size[0] - 0.5 and v > -0.5 and v < size[1] - 0.5)


@compiled
def _cell(u: np.float32, v: np.float32, per_cell: np.float32) -> tuple[int, int]:
    return int((v + np.float32(0.5)) * per_cell), int((u + np.float32(0.5)) * per_cell)
