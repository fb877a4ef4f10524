"""Views of a face that turns to and fro under a light that stands still.

To and fro and not around: a face was seen from one side, and has no back.
"""

from collections.abc import Iterator
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bytes, Floats
from denseface.recon.face import MAX_STEP, DenseCloud
from denseface.service.export._drawing import BACKGROUND

__all__ = ["FRAMES_PER_S", "HEIGHT", "WIDTH", "turned"]

WIDTH, HEIGHT = 480, 600
"""Pixels."""
FRAMES_PER_S = 24
_FRAMES = 96
"""Of a loop, which takes four seconds; a multiple of four, so that views come twice."""
_REACH_DEG = 45.0
"""Largest angle to either side."""
_FILL = 0.84
"""Share of the picture's width and height that the face may take while it turns."""
_OVERSAMPLING = 2
_LIGHT = np.array([-0.45, -0.6, -0.66], np.float32)
"""Direction to the light, camera frame: from above the viewer's left shoulder."""
_AMBIENT, _DIRECT = 0.62, 0.55
"""Parts of a point's colour: its colour was lit already when it was taken."""
_MOST_PARTS = 64
"""Of the way between two neighbouring points."""


class _Samples(NamedTuple):
    """Points on the surface, at most a fine pixel apart along each fine row, from any angle.

    Turned about the vertical, a point stays in its row.
    """

    rows: NDArray[np.int32]
    x: Floats
    z: Floats
    colors: Floats
    normals: Floats


def turned(cloud: DenseCloud) -> Iterator[Bytes]:
    """Draw a loop's frames, (HEIGHT, WIDTH, 3) uint8 RGB: after the last comes the first again."""
    samples, scale = _sampled(cloud)
    drawn: dict[int, Bytes] = {}
    for frame in range(_FRAMES):
        # An angle comes again on the way back: the sine of a is that of half a turn less a.
        along = (frame + _FRAMES // 4) % _FRAMES
        step = min(along, _FRAMES - along)
        if step not in drawn:
            angle = np.deg2rad(_REACH_DEG) * np.sin(2 * np.pi * frame / _FRAMES)
            drawn[step] = _view(samples, scale, float(angle))
        yield drawn[step]


def _sampled(cloud: DenseCloud) -> tuple[_Samples, float]:
    """Give samples about the face's middle, and the fine pixels for each millimetre."""
    low, high = cloud.points.min(axis=0), cloud.points.max(axis=0)
    points = cloud.points - (low + high) / 2
    angle = np.deg2rad(_REACH_DEG)
    half = np.array([max(np.abs(points[:, 0]).max(), *(
        np.abs(points[:, 0] * np.cos(angle) + side * points[:, 2] * np.sin(angle)).max()
        for side in (-1, 1))), np.abs(points[:, 1]).max()])
    scale = _OVERSAMPLING * float(
        _FILL / 2 * (np.array([WIDTH, HEIGHT]) / np.maximum(half, 1.0)).min())
    known, values = _lines(cloud, points, scale)
    # From each point to the next one of its row, unless that is on another surface.
    way = np.hypot(np.diff(values[..., 0], axis=1), np.diff(values[..., 1], axis=1))
    joined = known[:, 1:] & known[:, :-1]
    joined &= np.abs(np.diff(values[..., 1], axis=1)) <= MAX_STEP * cloud.grid_step_mm
    rows, columns = np.nonzero(joined)
    parts = np.clip(np.ceil(way[joined] * scale), 1, _MOST_PARTS).astype(np.int64)
    which = np.repeat(np.arange(len(parts)), parts)
    share = (np.arange(len(which)) - np.repeat(np.cumsum(parts) - parts, parts)) / parts[which]
    rows, columns = rows[which], columns[which]
    start = values[rows, columns]
    there = start + share.astype(np.float32)[:, None] * (values[rows, columns + 1] - start)
    top = round(HEIGHT * _OVERSAMPLING / 2 - float(half[1]) * scale)
    return _Samples((rows + top).astype(np.int32), there[:, 0].copy(), there[:, 1].copy(),
                    there[:, 2:5].copy(), there[:, 5:].copy()), scale


def _lines(
    cloud: DenseCloud, points: Floats, scale: float
) -> tuple[NDArray[np.bool_], Floats]:
    """Give x, z, colour and normal where a picture's rows meet the grid's columns.

    Returns
    -------
    known : (rows, columns) bool, where there is a point
    values : (rows, columns, 8) float32
    """
    cells = cloud.cells - cloud.cells.min(axis=0)
    every = max(1, int(1 / (scale * cloud.grid_step_mm)))
    some = (cells[:, 1] % every == 0)
    cells, points = cells[some] // np.array([1, every], np.int32), points[some]
    shape = cells.max(axis=0) + 1
    grid, known = np.zeros((*shape, 8), np.float32), np.zeros(shape, np.bool_)
    places = cells[:, 0], cells[:, 1]
    known[places] = True
    grid[places] = np.column_stack(
        [points[:, 0], points[:, 2], cloud.colors[some], cloud.normals[some]])
    at = np.arange(0, (shape[0] - 1) * cloud.grid_step_mm * scale + 1) / (
        scale * cloud.grid_step_mm)
    at = np.minimum(at, shape[0] - 1)
    above = np.minimum(np.floor(at).astype(np.intp), max(shape[0] - 2, 0))
    below = np.minimum(above + 1, shape[0] - 1)
    nearest = np.round(at).astype(np.intp)
    far = np.abs(grid[above, :, 1] - grid[below, :, 1]) > MAX_STEP * cloud.grid_step_mm
    both = known[above] & known[below] & ~far
    share = (at - above).astype(np.float32)[:, None, None]
    values = np.where(both[..., None], grid[above] + share * (grid[below] - grid[above]),
                      grid[nearest])
    return known[nearest], values.astype(np.float32)


def _view(samples: _Samples, scale: float, angle: float) -> Bytes:
    cosine, sine = np.float32(np.cos(angle)), np.float32(np.sin(angle))
    x = samples.x * cosine - samples.z * sine
    z = samples.x * sine + samples.z * cosine
    width = WIDTH * _OVERSAMPLING
    pixels = samples.rows * width + (x * np.float32(scale) + np.float32(width / 2)).astype(np.int32)
    # The nearest of each pixel: its depth in the upper bits, which sample it is in the lower.
    depths = ((np.float32(z.max()) - z) * np.float32(100)).astype(np.int64)
    nearest = np.full(HEIGHT * _OVERSAMPLING * width, -1, np.int64)
    np.maximum.at(nearest, pixels, (depths << 32) + np.arange(len(depths)))
    shown = np.flatnonzero(nearest >= 0)
    which = nearest[shown] & 0xFFFFFFFF
    image = np.full((len(nearest), 3), BACKGROUND, np.uint8)
    light = _LIGHT / np.linalg.norm(_LIGHT)
    light = np.array([light[0] * cosine + light[2] * sine, light[1],
                      light[2] * cosine - light[0] * sine], np.float32)
    direct = np.maximum(samples.normals[which] @ light, 0)
    shares = direct * np.float32(_DIRECT) + np.float32(_AMBIENT)
    image[shown] = np.minimum(samples.colors[which] * shares[:, None], np.float32(255))
    return np.asarray(cv2.resize(image.reshape(HEIGHT * _OVERSAMPLING, width, 3), (WIDTH, HEIGHT),
                                 interpolation=cv2.INTER_AREA), np.uint8)
