"""The loops that draw a surface as it would look from elsewhere, compiled."""

from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats, Ints
from denseface.recon.numerics.jit import compiled

_MEASURED = 0.3
"""Weight below which a sample counts as not measured."""
_STEEPEST = 4.0
"""Slope beyond which neighbours are not one surface."""


class Surface(NamedTuple):
    """Samples of a surface."""

    points: Floats
    """(n, 3), mm."""
    normals: Floats
    """(n, 3), toward the camera."""
    relief: Floats
    """(n,), mm, how far each stands out of its surroundings."""
    places: Ints
    """(n,), which sample of the grid each is."""


class View(NamedTuple):
    """What is drawn into, all (H, W)."""

    nearest: Floats
    """mm; very large where nothing is."""
    grey: Floats
    seen: Floats
    """1 where a sample is."""
    source: Ints
    """Which sample of the grid is seen; -1 for none."""


@compiled
def surface_samples(
    depth: Floats, weight: Floats, relief: Floats, near_face: Bools,
    corner: tuple[float, float], step: tuple[float, float], out: Surface
) -> int:
    """Turn a grid of depths into points and normals, and give their number.

    depth : (h, w), mm; relief : of the same shape, mm
    weight : (h, w), share of each that was measured
    near_face : (h, w), what is wanted
    corner : x and y of the first sample at a depth of 1
    step : from sample to sample, likewise
    """
    rows, columns = depth.shape
    count = 0
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            if not near_face[i, j] or min(
                    weight[i, j], weight[i, j - 1], weight[i, j + 1], weight[i - 1, j],
                    weight[i + 1, j]) <= _MEASURED:
                continue
            z = depth[i, j]
            dz_dx = (depth[i, j + 1] - depth[i, j - 1]) / (2 * step[0] * z)
            dz_dy = (depth[i + 1, j] - depth[i - 1, j]) / (2 * step[1] * z)
            if max(abs(dz_dx), abs(dz_dy)) > _STEEPEST:
                continue
            length = np.sqrt(1 + dz_dx * dz_dx + dz_dy * dz_dy)
            out.points[count, 0] = (corner[0] + j * step[0]) * z
            out.points[count, 1] = (corner[1] + i * step[1]) * z
            out.points[count, 2] = z
            out.normals[count, 0] = dz_dx / length
            out.normals[count, 1] = dz_dy / length
            out.normals[count, 2] = -1 / length
            out.relief[count] = relief[i, j]
            out.places[count] = i * columns + j
            count += 1
    return count


@compiled
def draw_view(
    surface: Surface, turn: Doubles, middle: Doubles, pixel_mm: float,
    light: tuple[float, float, float], relief_gain: float, view: View
) -> None:
    """Draw samples turned about a point, as seen from far away along z.

    turn : (3, 3), from the camera's axes to the view's
    middle : (3,), mm, the point in the middle of the view
    light : toward it, the view's axes; of the length that a surface facing it is to have as grey
    relief_gain : grey levels for each mm of relief
    """
    height, width = view.grey.shape
    for k in range(len(surface.points)):
        x = surface.points[k, 0] - middle[0]
        y = surface.points[k, 1] - middle[1]
        z = surface.points[k, 2] - middle[2]
        u = int(np.floor((turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z) / pixel_mm + width / 2))
        v = int(np.floor((turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z) / pixel_mm
                         + height / 2))
        away = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
        if not (0 <= u < width and 0 <= v < height) or away >= view.nearest[v, u]:
            continue
        x, y, z = surface.normals[k, 0], surface.normals[k, 1], surface.normals[k, 2]
        facing = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
        if facing >= 0:
            continue
        shade = ((turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z) * light[0]
                 + (turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z) * light[1]
                 + facing * light[2])
        view.nearest[v, u] = away
        view.grey[v, u] = min(max(max(shade, 0) + relief_gain * surface.relief[k], 1), 255)
        view.seen[v, u] = 1
        view.source[v, u] = surface.places[k]


@compiled
def finish_view(
    view: View, grey_around: Floats, seen_around: Floats, least_seen: float, centers: Bools,
    grey: Bytes, allowed: Bools
) -> None:
    """Fill the gaps between the samples, and mark where the centre of a face can be.

    grey_around, seen_around : those of `view`, smoothed alike
    least_seen : with less around it a pixel stays black
    centers : (h, w), of the samples' grid
    grey, allowed : (H, W), written; zero and False before
    """
    height, width = grey.shape
    columns = centers.shape[1]
    for v in range(height):
        for u in range(width):
            source = view.source[v, u]
            if source < 0:
                if seen_around[v, u] >= least_seen:
                    grey[v, u] = np.uint8(grey_around[v, u] / seen_around[v, u])
                continue
            grey[v, u] = np.uint8(view.grey[v, u])
            if centers[source // columns, source % columns]:
                for i in range(max(v - 1, 0), min(v + 2, height)):
                    for j in range(max(u - 1, 0), min(u + 2, width)):
                        allowed[i, j] = True
