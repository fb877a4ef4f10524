"""Depth in coarser pixels: the means of squares of them, which carry less noise."""

from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.frame import DepthMeaning, DepthRounding, RgbdFrame
from denseface.recon.arrays import Floats, Ints
from denseface.recon.numerics.jit import compiled

_UNIT_UM = 250
"""Unit of a mean, at most: fine enough for that of four readings in whole millimetres, and sixteen
metres fit into its 16 bits."""
_STEP_MM = 8.0
"""What is farther than a square's nearest reading by more than this for each pixel between them is
of another surface."""
_MEASURED = 0.6
"""Share of a square that is read on one surface, at least. A mean of less lies aside of its middle,
which on a slope is an error of depth."""

_Counts = NDArray[np.uint16]


def pooled(
    frame: RgbdFrame, window: tuple[slice, slice], side: int
) -> tuple[RgbdFrame, tuple[slice, slice]]:
    """Give the same frame in depth pixels that are `side` times as large each way.

    Rows and columns behind the last whole square are left out.

    Parameters
    ----------
    frame : with colour, which stays as it is
    window : rows and columns of the depth that are needed; elsewhere is no reading
    side : pixels averaged each way, at least 1

    Returns
    -------
    The frame, and the rows and columns of its depth that hold the window.
    """
    meaning = frame.depth_meaning
    unit_um = min(meaning.unit_um, _UNIT_UM)
    height, width = (length // side for length in frame.depth.shape)
    depth = np.zeros((height, width), np.uint16)
    rows, columns = (slice(part.start // side, min(-(-part.stop // side), length))
                     for part, length in zip(window, depth.shape, strict=True))
    part = frame.depth[rows.start * side:rows.stop * side, columns.start * side:columns.stop * side]
    depth[rows, columns] = _means(
        np.array(part), side, int(np.ceil(_MEASURED * side * side)), meaning.max_count,
        (meaning.unit_um / unit_um, 1000 * meaning.offset_mm / unit_um,
         1000 * _STEP_MM * (side - 1) / unit_um))
    calibration = _calibration(frame.depth_camera, frame.calibration.color, frame.depth_to_color,
                               side)
    return replace(frame, depth=depth, registered=False, calibration=calibration,
                   depth_meaning=DepthMeaning(unit_um, DepthRounding.NONE)), (rows, columns)


def own_readings(
    frame: RgbdFrame, pixels: Ints, z: Floats, side: int
) -> tuple[Floats, Ints]:
    """Give the readings whose means are the depths of larger pixels.

    Parameters
    ----------
    frame : that of `pooled`
    pixels : (n, 2) int32, (row, column) of larger pixels
    z : (n,) float32, mm, their depths

    Returns
    -------
    points : (m, 3) float32, mm, of which z alone is set
    pixels : (m, 2) int32, (row, column) in the frame
    """
    meaning = frame.depth_meaning
    first = pixels.min(axis=0)
    rows, columns = (slice(begin * side, end * side)
                     for begin, end in zip(first, pixels.max(axis=0) + 1, strict=True))
    return _own_readings(
        np.array(frame.depth[rows, columns]), pixels, (int(first[0]), int(first[1])), z, side,
        meaning.max_count, (meaning.unit_um / 1000, meaning.offset_mm, _STEP_MM * (side - 1)))


@lru_cache(maxsize=8)
def _calibration(
    camera: CameraModel, color: CameraModel, pose: DepthToColor, side: int
) -> Calibration:
    coarse = camera.model_copy(update={
        "width": camera.width // side, "height": camera.height // side,
        "fx": camera.fx / side, "fy": camera.fy / side,
        "cx": (camera.cx + 0.5) / side - 0.5, "cy": (camera.cy + 0.5) / side - 0.5})
    return Calibration(depth=coarse, color=color, depth_to_color=pose)


@compiled
def _means(
    depth: _Counts, side: int, least: int, most: int, scale: tuple[float, float, float]
) -> _Counts:
    """Give the mean of each square's nearest surface, 0 where less than `least` of it is read.

    depth : (rows * side, columns * side), contiguous, counts; 0 and more than `most`: no reading
    scale : counts of the mean for each of the depth, what is added to them, and the largest step
        within a square, in them
    """
    rows, columns = depth.shape[0] // side, depth.shape[1] // side
    factor, offset, step = scale
    out = np.zeros((rows, columns), np.uint16)
    for row in range(rows):
        for column in range(columns):
            top, left = row * side, column * side
            nearest = np.int64(most + 1)
            for i in range(side):
                for j in range(side):
                    one = np.int64(depth[top + i, left + j])
                    if one > 0:
                        nearest = min(nearest, one)
            limit = np.int64(min(nearest + step / factor, float(most)))
            count, total = 0, np.int64(0)
            for i in range(side):
                for j in range(side):
                    one = np.int64(depth[top + i, left + j])
                    if 0 < one <= limit:
                        count += 1
                        total += one
            if count >= least:
                mean = total / count * factor + offset + 0.5
                if mean < 65536:
                    out[row, column] = np.uint16(mean)
    return out


@compiled
def _own_readings(
    depth: _Counts, pixels: Ints, first: tuple[int, int], z: Floats, side: int, most: int,
    scale: tuple[float, float, float],
) -> tuple[Floats, Ints]:
    """Gather the readings of squares.

    depth : the squares' part of the depth image, counts, from the square `first` on
    scale : mm of a count, what is added to each depth, mm, and the largest distance from z, mm
    """
    unit, offset, step = np.float32(scale[0]), np.float32(scale[1]), np.float32(scale[2])
    points = np.zeros((len(pixels) * side * side, 3), np.float32)
    own = np.empty((len(pixels) * side * side, 2), np.int32)
    count = 0
    for k in range(len(pixels)):
        for i in range(side):
            for j in range(side):
                row, column = pixels[k, 0] * side + i, pixels[k, 1] * side + j
                one = depth[row - first[0] * side, column - first[1] * side]
                reading = np.float32(one) * unit + offset
                if 0 < one <= most and abs(reading - z[k]) <= step:
                    points[count, 2] = reading
                    own[count, 0], own[count, 1] = row, column
                    count += 1
    return points[:count].copy(), own[:count].copy()
