"""The loops of the registration, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["EMPTY", "project", "project_points", "sample_image", "visible_mask"]

Rays = NDArray[np.float64]

EMPTY = np.float32(1e30)
"""Where nothing is in the z-buffer, mm; no infinity, which compiled code may take for no number."""


@compiled
def project(
    depth: NDArray[np.uint16], offset_mm: float, rays: tuple[Rays, Rays],
    begin: tuple[int, int], step: tuple[int, int], rotation: NDArray[np.float64],
    translation: NDArray[np.float64], camera: NDArray[np.float64], pitch: float,
    points: NDArray[np.float32], pixels: NDArray[np.float32], color_depth: NDArray[np.float32],
    nearest: NDArray[np.float32],
) -> tuple[int, int, int, int]:
    """Back-project each measured depth, move it to the colour camera, and project it there.

    depth : (H, W), the pixels `begin`, `begin + step`, ... of the image that `rays` are of
    rays : x and y at z = 1 of each pixel
    camera : width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3 of the colour camera
    pitch : side of the z-buffer's cells, pixels
    points, pixels, color_depth : (H, W, 3), (H, W, 2), (H, W), written where there is a depth
        (the last two: and the colour camera is before it)
    nearest : the z-buffer, lowered to what falls into its cells inside the image

    Gives the first row, the last, the first column and the last of the cells that were lowered; of
    none, the first is behind the last.
    """
    width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3 = camera
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    t0, t1, t2 = translation
    offset, per_cell = np.float32(offset_mm), np.float32(1) / np.float32(pitch)
    columns = depth.shape[1]
    across, along = np.empty(columns), np.empty(columns)
    px, py, pz = (np.empty(columns, np.float32), np.empty(columns, np.float32),
                  np.empty(columns, np.float32))
    us, vs, fars = (np.empty(columns, np.float32), np.empty(columns, np.float32),
                    np.empty(columns, np.float32))
    top, bottom, left, right = nearest.shape[0], -1, nearest.shape[1], -1
    for i in range(depth.shape[0]):
        for j in range(columns):
            row, column = begin[0] + i * step[0], begin[1] + j * step[1]
            across[j], along[j] = rays[0][row, column], rays[1][row, column]
        # All of a row at once, measured or not, takes less time than to ask for each.
        line = depth[i]
        for j in range(columns):
            z = np.float32(line[j]) + offset
            x0, y0 = np.float32(across[j] * z), np.float32(along[j] * z)
            px[j], py[j], pz[j] = x0, y0, z
            far = r20 * x0 + r21 * y0 + r22 * z + t2
            share = 1 / (far if far > 0 else 1.0)
            x = (r00 * x0 + r01 * y0 + r02 * z + t0) * share
            y = (r10 * x0 + r11 * y0 + r12 * z + t1) * share
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            us[j] = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
            vs[j] = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy
            fars[j] = far
        for j in range(columns):
            if line[j] == 0:
                continue
            points[i, j, 0], points[i, j, 1], points[i, j, 2] = px[j], py[j], pz[j]
            far, u, v = fars[j], us[j], vs[j]
            if far <= 0:
                continue
            pixels[i, j, 0], pixels[i, j, 1] = u, v
            color_depth[i, j] = far
            if _inside(u, v, width, height):
                row, column = _cell(u, v, per_cell)
                if far < nearest[row, column]:
                    nearest[row, column] = far
                top, bottom = min(top, row), max(bottom, row)
                left, right = min(left, column), max(right, column)
    return top, bottom, left, right


@compiled
def project_points(
    points: NDArray[np.float32], rotation: NDArray[np.float64],
    translation: NDArray[np.float64], camera: NDArray[np.float64], pixels: NDArray[np.float32],
    color_depth: NDArray[np.float32],
) -> None:
    """Move points, (1, n, 3), to the colour camera, and project them there, as `project` does.

    pixels, color_depth : (1, n, 2) and (1, n), written; the last 0 behind the camera
    """
    _, _, fx, fy, cx, cy, k1, k2, p1, p2, k3 = camera
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    t0, t1, t2 = translation
    for i in range(points.shape[1]):
        x0, y0, z = points[0, i, 0], points[0, i, 1], points[0, i, 2]
        far = r20 * x0 + r21 * y0 + r22 * z + t2
        share = 1 / (far if far > 0 else 1.0)
        x = (r00 * x0 + r01 * y0 + r02 * z + t0) * share
        y = (r10 * x0 + r11 * y0 + r12 * z + t1) * share
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        pixels[0, i, 0] = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
        pixels[0, i, 1] = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy
        color_depth[0, i] = far if far > 0 else 0.0


@compiled
def visible_mask(
    pixels: NDArray[np.float32], color_depth: NDArray[np.float32], nearest: NDArray[np.float32],
    pitch: float, hidden_mm: float, hidden_share: float, width: int, height: int,
) -> NDArray[np.bool_]:
    """Say which points are inside an image of that size and hidden by none.

    nearest : the z-buffer, each cell lowered to the least of the cells around it
    """
    visible = np.zeros(color_depth.shape, np.bool_)
    per_cell, share = np.float32(1) / np.float32(pitch), np.float32(hidden_share)
    for i in range(color_depth.shape[0]):
        for j in range(color_depth.shape[1]):
            z = color_depth[i, j]
            if z <= 0:
                continue
            u, v = pixels[i, j, 0], pixels[i, j, 1]
            if _inside(u, v, width, height):
                row, column = _cell(u, v, per_cell)
                visible[i, j] = z <= nearest[row, column] + max(np.float32(hidden_mm), share * z)
    return visible


@compiled
def sample_image(
    pixels: NDArray[np.float32], visible: NDArray[np.bool_], image: NDArray[np.uint8]
) -> NDArray[np.uint8]:
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
            right, bottom = min(left + 1, np.uint32(width - 1)), min(top + 1,
                                                                     np.uint32(height - 1))
            across, down = u - np.float32(left), v - np.float32(top)
            for c in range(3):
                one, other = np.float32(image[top, left, c]), np.float32(image[bottom, left, c])
                upper = one + across * (np.float32(image[top, right, c]) - one)
                lower = other + across * (np.float32(image[bottom, right, c]) - other)
                colors[i, j, c] = np.uint8(np.int32(
                    upper + down * (lower - upper) + np.float32(0.5)))
    return colors


@compiled
def _inside(u: np.float32, v: np.float32, width: float, height: float) -> bool:
    return bool(u > -0.5 and u < width - 0.5 and v > -0.5 and v < height - 0.5)


@compiled
def _cell(u: np.float32, v: np.float32, per_cell: np.float32) -> tuple[int, int]:
    return int((v + np.float32(0.5)) * per_cell), int((u + np.float32(0.5)) * per_cell)
