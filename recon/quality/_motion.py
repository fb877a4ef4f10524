"""How far a face moved between two frames, by what both images show where it was."""

import math
from dataclasses import dataclass
from typing import Self, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Floats
from denseface.recon.face import Box

__all__ = ["Patch", "motion_mm"]

_T = TypeVar("_T", bound=np.generic)

_SIDE, _SHADED_SIDE = 96, 48
"""Pixels of a patch: about those of a face at 0.9 m; half as many of shaded depth, whose noise
stands still while the face moves."""
_DEPTH_SIDE = 32
"""Pixels of its depth."""
_MIN_RESPONSE = 0.05
"""A phase correlation whose peak holds less says nothing."""
_MOST_SHIFT = 0.25
"""Of a patch: what moved farther is found by its box alone."""
_PERIOD_US = 33_333
"""Of a sensor of 30 frames a second: motion is given for this time."""
_LONGEST_US = 500_000
"""Frames farther apart show no motion, only where the face went."""
_WINDOWS = {side: cv2.createHanningWindow((side, side), cv2.CV_32F)
            for side in (_SIDE, _SHADED_SIDE)}
"""What fades toward the sides of a patch, so that its border is no edge."""


@dataclass(frozen=True, eq=False)
class Patch:
    """The part of a frame that shows the face.

    Attributes
    ----------
    roi : x, y, width, height in the colour image
    image : (n, n) float32, brightness, n = 96 or 48
    depth_roi : the same in the depth image
    depth : (32, 32) float32, mm, 0 where nothing was measured
    box, distance_mm : the face's
    exposed_us : when, by any clock
    """

    roi: Box
    image: Floats
    depth_roi: Box
    depth: Floats
    box: Box
    distance_mm: float
    exposed_us: int

    @classmethod
    def of(
        cls, frame: RgbdFrame, box: Box, distance_mm: float, exposed_us: int, *, shaded: bool
    ) -> Self | None:
        """Cut a face out of colour or shaded depth; None where none of its box is inside."""
        roi = _inside(box, frame.calibration.color.width, frame.calibration.color.height)
        x, y, w, h = box
        corners = frame.calibration.color.back_project(
            np.array([[x, y], [x + w, y + h]], np.float64), distance_mm)
        to_color = frame.depth_to_color
        corners = (corners - to_color.translation_mm) @ np.array(to_color.rotation)
        (left, top), (right, bottom) = np.rint(frame.depth_camera.project(corners)).astype(int)
        camera = frame.depth_camera
        depth_roi = _inside((left, top, right - left, bottom - top), camera.width, camera.height)
        if roi is None or depth_roi is None:
            return None
        return cls(roi, _image(frame, roi, _SHADED_SIDE if shaded else _SIDE), depth_roi,
                   _depth(frame, depth_roi), box, distance_mm,
                   exposed_us)


def motion_mm(frame: RgbdFrame, now: Patch, before: Patch | None) -> float | None:
    """Give how far a face moved in a thirtieth of a second, mm; None where that cannot be told."""
    if before is None:
        return None
    elapsed = now.exposed_us - before.exposed_us
    if not 0 < elapsed <= _LONGEST_US:
        return None
    mm_per_px = now.distance_mm / frame.calibration.color.fx
    side = len(before.image)
    here = _image(frame, before.roi, side)
    (dx, dy), response = cv2.phaseCorrelate(before.image, here, _WINDOWS[side])
    if response >= _MIN_RESPONSE and max(abs(dx), abs(dy)) <= _MOST_SHIFT * side:
        across, along = dx * before.roi[2] / side, dy * before.roi[3] / side
    else:
        (ax, ay, aw, ah), (bx, by, bw, bh) = before.box, now.box
        across, along = bx + bw / 2 - ax - aw / 2, by + bh / 2 - ay - ah / 2
    there = _depth(frame, before.depth_roi)
    both = (there > 0) & (before.depth > 0)
    away = float(np.median(there[both] - before.depth[both])) if both.any() else 0.0
    moved = math.hypot(across * mm_per_px, along * mm_per_px, away)
    return moved * _PERIOD_US / elapsed


def _image(frame: RgbdFrame, roi: Box, side: int) -> Floats:
    gray = cv2.cvtColor(_part(frame.rgb, roi), cv2.COLOR_RGB2GRAY)
    small = cv2.resize(gray, (side, side), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32)


def _depth(frame: RgbdFrame, roi: Box) -> Floats:
    size = _DEPTH_SIDE, _DEPTH_SIDE
    small = cv2.resize(_part(frame.depth, roi), size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(small, np.float32) * np.float32(frame.depth_meaning.unit_um / 1000)


def _part(image: NDArray[_T], roi: Box) -> NDArray[_T]:
    x, y, w, h = roi
    return np.ascontiguousarray(image[y:y + h, x:x + w])


def _inside(box: Box, width: int, height: int) -> Box | None:
    """Give the part of a box inside an image, None for none."""
    x, y, w, h = box
    left, top, right, bottom = max(x, 0), max(y, 0), min(x + w, width), min(y + h, height)
    return (left, top, right - left, bottom - top) if right > left and bottom > top else None
