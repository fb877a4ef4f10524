"""Several consecutive frames of one still scene, averaged into one frame.

A reading's noise differs from frame to frame, and with it the step that it falls on. Their mean is
nearer to the truth, where nothing moved meanwhile: frames in which the near part of the scene moved
are left out, and so is each reading that is far from the others of its pixel.
"""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.arguments import expect
from denseface.capture.errors import FrameError
from denseface.capture.frame import MAX_BURST, DepthMeaning, DepthRounding, RgbdFrame

__all__ = ["fuse"]

_NEAR_MM = (300.0, 1500.0)
"""Where a face is looked for motion."""
_CELL = 16
"""Pixels: side of the cells whose mean depth tells motion; the noise of a mean is a tenth of a
reading's."""
_LEAST_CELLS = 20
"""With fewer near cells there is nobody whose motion could matter."""
_MOVED_MM = 3.0
"""A frame is left out where a tenth of the near cells are off by more: the noise of a face stays
below 1 mm, and 3 mm is what a hint of the quality gate calls motion."""
_MOVED_SHARE = 0.1
_AWAY_MM, _AWAY_SHARE = 4.0, 6e-6
"""A reading farther than this from its pixel's median, mm and mm per mm^2 of depth, is left out:
some four standard deviations of a structured-light sensor, and its step."""
_UNITS_UM = (100, 200, 250, 500, 1000)
"""Units of the result; the finest in which its farthest reading fits 16 bits."""


def fuse(frames: Sequence[RgbdFrame]) -> RgbdFrame:
    """Average the depth of consecutive frames of one sensor.

    Parameters
    ----------
    frames : 1 to `MAX_BURST`, oldest first, with equal calibration and meaning of their depth

    Returns
    -------
    the first frame, its depth the mean of all in which the same stood still, in finer units;
    `origin.fused` says how many. A pixel has a reading where at least half of them have one.

    Raises
    ------
    FrameError
        There is none, there are too many, or they are not of one sensor.
    """
    expect("frames", frames, Sequence)
    for frame in frames:
        expect("frames", frame, RgbdFrame)
    if not 1 <= len(frames) <= MAX_BURST:
        raise FrameError(f"a burst has 1 to {MAX_BURST} frames, found {len(frames)}")
    first = frames[0]
    for other in frames[1:]:
        if (other.calibration, other.registered, other.depth_meaning) != (
                first.calibration, first.registered, first.depth_meaning):
            raise FrameError("the frames of a burst are not all of one sensor and mode")
    if len(frames) == 1:
        return first
    meaning = first.depth_meaning
    depths = [np.where(frame.depth <= meaning.max_count, frame.depth, 0)
              * np.float32(meaning.unit_um / 1000) for frame in frames]
    still = [depths[0]] + [depth for depth in depths[1:] if not _moved(depths[0], depth)]
    left_out = len(frames) - len(still)
    if left_out:
        first = first.with_note(f"{left_out} of the burst's {len(frames)} frames are left out: "
                                "what stands before the sensor moved")
    if len(still) == 1:
        return first
    mean = _robust_mean(np.stack(still))
    unit_um = next((unit for unit in _UNITS_UM if mean.max() * 1000 / unit <= 65535),
                   _UNITS_UM[-1])
    counts = np.where(mean > 0, (mean + np.float32(meaning.offset_mm)) * (1000 / unit_um), 0)
    return replace(
        first, depth=np.minimum(np.rint(counts), 65535).astype(np.uint16),
        depth_meaning=DepthMeaning(unit_um, DepthRounding.NONE, meaning.max_mm),
        origin=replace(first.origin, fused=len(still)))


def _moved(reference: NDArray[np.float32], depth: NDArray[np.float32]) -> bool:
    """Say whether the near part of the scene moved between two depth images, mm."""
    near = ((reference > _NEAR_MM[0]) & (reference < _NEAR_MM[1])
            & (depth > _NEAR_MM[0]) & (depth < _NEAR_MM[1]))
    weight = _cells(near.astype(np.float32))
    full = weight > 0.75
    if full.sum() < _LEAST_CELLS:
        return False
    off = _cells(np.where(near, depth - reference, 0))[full] / weight[full]
    return bool((np.abs(off) > _MOVED_MM).mean() > _MOVED_SHARE)


def _cells(image: NDArray[np.float32]) -> NDArray[np.float32]:
    """Give the means of cells of `_CELL` x `_CELL` pixels."""
    height, width = (max(1, side // _CELL) for side in image.shape)
    whole = image[:height * _CELL, :width * _CELL].astype(np.float32)
    return np.asarray(cv2.resize(whole, (width, height), interpolation=cv2.INTER_AREA), np.float32)


def _robust_mean(depths: NDArray[np.float32]) -> NDArray[np.float32]:
    """Average (n, H, W) depths, mm, without those far from their pixel's median; 0 for too few."""
    measured = depths > 0
    median = _median(depths, measured)
    limit = _AWAY_MM + np.float32(_AWAY_SHARE) * median * median
    counted = measured & (np.abs(depths - median) <= limit)
    number = counted.sum(axis=0)
    mean = np.where(counted, depths, 0).sum(axis=0) / np.maximum(number, 1)
    return np.where(2 * number >= len(depths), mean, 0).astype(np.float32)


def _median(depths: NDArray[np.float32], measured: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Give each pixel's lower median of its readings; 0 where there is none."""
    ordered = np.sort(np.where(measured, depths, np.float32(np.inf)), axis=0)
    middle = np.maximum(measured.sum(axis=0) - 1, 0) // 2
    median = np.take_along_axis(ordered, middle[None], axis=0)[0]
    return np.where(np.isfinite(median), median, 0).astype(np.float32)
