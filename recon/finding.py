"""Finding the face: in colour, or in depth alone where there is no colour or none that tells."""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import cv2
import numpy as np

from denseface.capture.frame import RgbdFrame
from denseface.capture.rotation import ROTATIONS, rotate_frame
from denseface.recon.arrays import Bools, Floats
from denseface.recon.detection import Detection, detect_by_depth, detect_face, turned_by
from denseface.recon.errors import (
    FaceWithoutDepthError,
    NoDepthError,
    NoFaceError,
    ReconstructionError,
)
from denseface.recon.face import Box, FaceCandidate
from denseface.recon.intermediate import Registration
from denseface.recon.judgement import score_quickly
from denseface.recon.registration import register, with_shaded_depth, without_color
from denseface.recon.segmentation import box_window

__all__ = ["Found", "find_another", "find_face"]

_SPARSE = 4
"""Every so many pixels are enough to find a face and weigh its depth."""

_DARK, _DARK_SHARE = 48.0, 0.02
"""Grey below which a picture is dark, and share of the readings that must be so for a second look
by depth. A face in a hundredth of a room's light has 13, in a tenth 57."""
_DARK_PLACE, _AROUND = 0.3, 17
"""Share of the readings around the middle of a face that must be so, too, in a square of so many
samples: of a face of which the picture tells nothing, half and more are."""
_LEAST_CONTRAST, _LEAST_TO_NOISE = 16.0, 60.0
"""A darker picture tells nothing of what is there if it has less contrast, in grey levels, or less
by what is left of the noise where both are smoothed. Of 240 pictures of faces in 0.005 to 0.05 of a
room's light, with noise of 2.5 and 8 levels, colour shows no face in 34; 33 of them are such."""
_DETAIL = 1 / 24
"""Of a box's width: the standard deviation of that smoothing. Eyes and mouth are larger."""
_ENDS = (2, 98)
"""Percentiles between which contrast is measured."""

_NO_CAMERA = "the sensor has no colour camera: the face is shaded grey"
_TOO_DARK = ("the colour image is too dark to show a face: it was found by depth alone and is "
             "shaded grey")


class Found(NamedTuple):
    """A face's box, and the frame in which it is one."""

    frame: RgbdFrame
    """The frame; with its shaded depth in place of colour where depth alone shows the face."""
    overview: Registration
    """Every few pixels of its depth."""
    detection: Detection
    colored: bool
    warning: str
    """Why the face has no colour; empty where it has."""

    def among(self, candidates: tuple[FaceCandidate, ...]) -> "Found":
        """Give the same with other candidates."""
        return self._replace(detection=replace(self.detection, candidates=candidates))


def find_face(frame: RgbdFrame, lap: Callable[[str], None]) -> Found:
    """Find the nearest face; where there is none, say so if there is one in the turned images.

    Parameters
    ----------
    frame : with colour or without
    lap : told when `overview` and `detection` are done

    Raises
    ------
    ReconstructionError
        As of `detect_face`.
    """
    if frame.color is None:
        frame = without_color(frame)
    overview = _overview(frame)
    lap("overview")
    try:
        found = _find(frame, overview, ())
    except NoFaceError as error:
        _hint_at_turned(frame, overview, error)
        raise
    lap("detection")
    return found


def find_another(found: Found, rejected: tuple[Box, ...]) -> Found:
    """Find the next face of a frame; parameters and errors are those of `find_face`."""
    if found.colored:
        return _find(found.frame, found.overview, rejected)
    return _find_by_depth(without_color(found.frame), found.overview, rejected, found.warning)


def _find(frame: RgbdFrame, overview: Registration, rejected: tuple[Box, ...]) -> Found:
    if frame.color is None:
        return _find_by_depth(frame, overview, rejected, _NO_CAMERA)
    try:
        found = detect_face(frame.rgb, overview, frame.calibration.color.fx, rejected,
                            score_quickly)
    except (NoFaceError, FaceWithoutDepthError):
        in_the_dark = _find_in_the_dark(frame, overview)
        if in_the_dark is None:
            raise
        return in_the_dark
    return Found(frame, overview, found, True, "")


def _find_by_depth(
    frame: RgbdFrame, overview: Registration, rejected: tuple[Box, ...], why: str,
    places: Bools | None = None,
) -> Found:
    found = detect_by_depth(frame, overview, rejected, score=score_quickly, places=places)
    shaded = with_shaded_depth(frame, box_window(overview, found.box))
    return Found(shaded, overview, found, False, why)


def _find_in_the_dark(frame: RgbdFrame, overview: Registration) -> Found | None:
    """Find a face by depth where the picture is too dark to show one."""
    gray = np.asarray(cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY), np.float32)
    u, v = overview.pixels[overview.visible].astype(np.intp).T
    dark = gray[v, u] < _DARK
    if not len(u) or np.mean(dark) < _DARK_SHARE:
        return None
    known = overview.visible.astype(np.float32)
    unlit = np.zeros_like(known)
    unlit[overview.visible] = dark
    around, all_around = (cv2.blur(one, (_AROUND, _AROUND)) for one in (unlit, known))
    places = np.asarray(around >= np.float32(_DARK_PLACE) * all_around)
    if not places.any():
        return None
    alone = without_color(frame)
    try:
        found = _find_by_depth(alone, _overview(alone), (), _TOO_DARK, places)
    except ReconstructionError:
        return None
    return found if _tells_nothing(gray, _in_color(found, overview)) else None


def _in_color(found: Found, overview: Registration) -> Box:
    """Give where the colour camera sees a box of the depth image."""
    step = overview.rows.step or 1
    x, y, w, h = (round(side / step) for side in found.detection.box)
    part = np.s_[max(y, 0):y + h, max(x, 0):x + w]
    seen = overview.pixels[part][overview.visible[part]]
    if not len(seen):
        return 0, 0, 0, 0
    left, top, right, bottom = map(int, (*seen.min(axis=0), *seen.max(axis=0)))
    return left, top, right - left + 1, bottom - top + 1


def _tells_nothing(gray: Floats, box: Box) -> bool:
    """Say whether a part of a picture is too dark to tell what is there."""
    x, y, w, h = box
    part = gray[y:y + h, x:x + w]
    if not part.size or float(np.median(part)) >= _DARK:
        return not part.size
    sigma = max(1.0, _DETAIL * w)
    smooth = cv2.GaussianBlur(part, (0, 0), sigma)
    dark, bright = np.percentile(smooth, _ENDS)
    noise = 1.4826 * float(np.median(np.abs(part - smooth))) / (2 * np.sqrt(np.pi) * sigma)
    return bool(bright - dark < max(_LEAST_CONTRAST, _LEAST_TO_NOISE * noise))


def _hint_at_turned(frame: RgbdFrame, overview: Registration, error: NoFaceError) -> None:
    """Raise an error that says so, where the turned images show a face."""
    if frame.color is None:
        degrees = next((turn for turn in ROTATIONS[1:] if _has_shape(rotate_frame(frame, turn))),
                       None)
    else:
        degrees = turned_by(frame.rgb, overview, frame.calibration.color.fx)
    if degrees is not None:
        hinting = NoFaceError(f"{error}; there is one when the images are turned by "
                              f"{degrees} degrees (--rotate {degrees})")
        hinting.candidates = error.candidates
        raise hinting from error


def _has_shape(frame: RgbdFrame) -> bool:
    try:
        detect_by_depth(frame, _overview(frame), ahead_only=True)
    except NoFaceError:
        return False
    return True


def _overview(frame: RgbdFrame) -> Registration:
    """Register every k-th pixel, or all where none of those has a depth."""
    sparse = slice(None, None, _SPARSE)
    try:
        return register(frame, sparse, sparse, colors=False)
    except NoDepthError:
        return register(frame, colors=False)
