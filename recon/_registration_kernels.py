"""The loops of the registration, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["EMPTY", "look", "project"]

EMPTY = np.float32(1e30)
"""Where nothing is in the z-buffer, mm; no infinity, which compiled code may take for no number."""


@compiled
def project(
    depth: NDArray[np.uint16], offset_mm: float, rays: NDArray[np.float64],
    begin: tuple[int, int], step: tuple[int, int], rotation: NDArray[np.float64],
    translation: NDArray[np.float64], camera: NDArray[np.float64], pitch: float,
    points: NDArray[np.float32], pixels: NDArray[np.float32], color_depth: NDArray[np.float32],
    nearest: NDArray[np.float32],
) -> None:
    """Back-project each measured depth, move it to the colour camera, and project it there.

    depth : (H, W), the pixels `begin`, `begin + step`, ... of the image that `rays` is of
    camera : width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3 of the colour camera
    pitch : side of the z-buffer's cells, pixels
    points, pixels, color_depth : (H, W, 3), (H, W, 2), (H, W), written where there is a depth
        (the last two: and the colour camera is before it)
    nearest : the z-buffer, lowered to what falls into its cells inside the image
    """
    width, height, fx, fy, cx, cy, k1, k2, p1, p2, k3 = camera
    for i in range(depth.shape[0]):
        for j in range(depth.shape[1]):
            if depth[i, j] == 0:
                continue
            z = np.float32(depth[i, j]) + np.float32(offset_mm)
            ray = rays[begin[0] + i * step[0], begin[1] + j * step[1]]
            px, py = np.float32(ray[0] * z), np.float32(ray[1] * z)
            points[i, j, 0], points[i, j, 1], points[i, j, 2] = px, py, z
            far = rotation[2, 0] * px + rotation[2, 1] * py + rotation[2, 2] * z + translation[2]
            if far <= 0:
                continue
            x = (rotation[0, 0] * px + rotation[0, 1] * py + rotation[0, 2] * z
                 + translation[0]) / far
            y = (rotation[1, 0] * px + rotation[1, 1] * py + rotation[1, 2] * z
                 + translation[1]) / far
            r2 = x * x + y * y
            radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
            u = fx * (x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)) + cx
            v = fy * (y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y) + cy
            pixels[i, j, 0], pixels[i, j, 1] = u, v
            color_depth[i, j] = far
            if _inside(np.float32(u), np.float32(v), width, height):
                row, column = _cell(np.float32(u), np.float32(v), pitch)
                nearest[row, column] = min(nearest[row, column], np.float32(far))


@compiled
def look(
    pixels: NDArray[np.float32], color_depth: NDArray[np.float32], nearest: NDArray[np.float32],
    pitch: float, hidden_mm: float, hidden_share: float, image: NDArray[np.uint8],
) -> tuple[NDArray[np.bool_], NDArray[np.uint8]]:
    """Say which points are inside the image and hidden by none, and give their colours, bilinear.

    nearest : the z-buffer, each cell lowered to the least of the cells around it
    """
    shape = color_depth.shape
    visible, colors = np.zeros(shape, np.bool_), np.zeros((*shape, 3), np.uint8)
    height, width = image.shape[:2]
    for i in range(shape[0]):
        for j in range(shape[1]):
            z = color_depth[i, j]
            if z <= 0:
                continue
            u, v = pixels[i, j]
            if not _inside(u, v, width, height):
                continue
            row, column = _cell(u, v, pitch)
            if z > nearest[row, column] + max(np.float32(hidden_mm), np.float32(hidden_share) * z):
                continue
            visible[i, j] = True
            u = min(max(u, np.float32(0)), np.float32(width - 1))
            v = min(max(v, np.float32(0)), np.float32(height - 1))
            left, top = int(u), int(v)
            right, bottom = min(left + 1, width - 1), min(top + 1, height - 1)
            across, down = u - np.float32(left), v - np.float32(top)
            for c in range(3):
                upper = (1 - across) * image[top, left, c] + across * image[top, right, c]
                lower = (1 - across) * image[bottom, left, c] + across * image[bottom, right, c]
                colors[i, j, c] = np.uint8((1 - down) * upper + down * lower + np.float32(0.5))
    return visible, colors


@compiled
def _inside(u: np.float32, v: np.float32, width: float, height: float) -> bool:
    return bool(u > -0.5 and u < width - 0.5 and v > -0.5 and v < height - 0.5)


@compiled
def _cell(u: np.float32, v: np.float32, pitch: float) -> tuple[int, int]:
    return int((v + np.float32(0.5)) / np.float32(pitch)), int(
        (u + np.float32(0.5)) / np.float32(pitch))
