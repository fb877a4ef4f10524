"""Both cameras and the pose between them, from what they see of a board (Zhang 2000).

Each camera is calibrated by itself, then both together by the views that both see; views that do
not fit are left out one by one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from denseface.capture import Calibration, DepthToColor
from denseface.service.errors import CalibrationFailedError
from denseface.service.tools.calibration._adjust import Accuracy, Rig, SharedView, adjusted
from denseface.service.tools.calibration._boards import Board, Corners
from denseface.service.tools.calibration._camera import calibrate_camera
from denseface.service.tools.calibration._variety import check_variety
from denseface.service.tools.calibration._views import BoardView, Size

__all__ = ["Solution", "ViewResult", "solve"]

_LEAST_VIEWS = 6
"""Seen by both cameras."""
_LEAST_SHARED = 6
"""Corners that both cameras see of a view."""
_OUTLIER = 2.5
"""A view whose error is so many times the median's does not fit: the board moved, or was bent."""
_OUTLIER_PX = 0.3
"""Below which no view is left out."""
_MOST_LEFT_OUT = 0.34
"""Share of the views."""
_MAX_RMS_PX = 1.0
"""Of all corners. A board that is printed flat and seen sharply gives 0.05 to 0.3."""
_ASK = ("is the board flat and of that kind, was it still while both images were taken, and is "
        "neither image mirrored?")

_Array = NDArray[np.float64]


class ViewResult(NamedTuple):
    """What became of a view."""

    name: str
    rms_px: float | None
    """Distance of corners from where they should be, both images; None where it was not used."""
    why_not: str
    """In words; empty where it was used."""
    depth: Corners | None
    color: Corners | None
    depth_error: _Array | None
    """(n, 2), pixels: where each corner should be, less where it is."""
    color_error: _Array | None


@dataclass(frozen=True)
class Solution:
    """A calibration and what it rests on."""

    calibration: Calibration
    rms_px: float
    """Of all corners of the views that were used, both images."""
    accuracy: Accuracy
    views: tuple[ViewResult, ...]


class _Fit(NamedTuple):
    rig: Rig
    accuracy: Accuracy
    errors: list[tuple[_Array, _Array]]
    """Of each view, as `Rig.errors`."""


def solve(
    views: Sequence[BoardView], board: Board, depth_size: Size, color_size: Size
) -> Solution:
    """Calibrate a sensor.

    Raises
    ------
    CalibrationFailedError
        Too few views, views too much alike, or corners that no two cameras see so.
    """
    why_not = {number: why for number, view in enumerate(views) if (why := _unusable(view))}
    used = [number for number in range(len(views)) if number not in why_not]
    if len(used) < _LEAST_VIEWS:
        reasons = "; ".join(sorted({f"{list(why_not.values()).count(why)} x {why}"
                                    for why in why_not.values()}))
        raise CalibrationFailedError(
            f"both cameras see the board in {len(used)} of {len(views)} pairs of images, expected "
            f"{_LEAST_VIEWS} or more (ten to twenty)" + (f": {reasons}" if reasons else ""))
    check_variety([views[number] for number in used], board, depth_size)
    sizes = depth_size, color_size
    fit = _fit([views[number] for number in used], board, sizes)
    most = int(len(used) * _MOST_LEFT_OUT)
    left_out: list[int] = []
    while True:
        rms = np.array([_rms(*errors) for errors in fit.errors])
        worst = int(rms.argmax())
        if rms[worst] <= max(_OUTLIER * float(np.median(rms)), _OUTLIER_PX):
            break
        if len(left_out) == most or len(used) == _LEAST_VIEWS:
            break
        left_out.append(used[worst])
        why_not[used[worst]] = f"does not fit the others (off by {rms[worst]:.2f} px)"
        del used[worst]
        fit = _fit([views[number] for number in used], board, sizes)
    total = _rms(*(error for errors in fit.errors for error in errors))
    if total > _MAX_RMS_PX:
        raise CalibrationFailedError(
            f"corners are {total:.2f} px off where they should be, expected less than "
            f"{_MAX_RMS_PX:g}: {_ASK}")
    by_number = dict(zip(used, fit.errors, strict=True))
    results = []
    for number, view in enumerate(views):
        of_depth, of_color = by_number.get(number, (None, None))
        _, depth, color = _shared(view)
        results.append(ViewResult(
            view.name, None if of_depth is None or of_color is None else _rms(of_depth, of_color),
            why_not.get(number, ""), depth, color, of_depth, of_color))
    return Solution(_calibration(fit.rig, sizes), total, fit.accuracy, tuple(results))


def _unusable(view: BoardView) -> str:
    if view.depth is None or view.color is None:
        where = [name for name, corners in (("infrared", view.depth), ("colour", view.color))
                 if corners is None]
        return f"no board found in the {' and the '.join(where)} image"
    shared = _shared(view).depth
    if shared is None or len(shared.ids) < _LEAST_SHARED:
        return f"fewer than {_LEAST_SHARED} corners are seen by both cameras"
    return ""


def _shared(view: BoardView) -> BoardView:
    """Give the view with those corners alone that both cameras see."""
    if view.depth is None or view.color is None:
        return view
    ids, of_depth, of_color = np.intersect1d(
        view.depth.ids, view.color.ids, assume_unique=True, return_indices=True)
    return BoardView(view.name, Corners(ids, view.depth.pixels[of_depth]),
                     Corners(ids, view.color.pixels[of_color]))


def _fit(views: Sequence[BoardView], board: Board, sizes: tuple[Size, Size]) -> _Fit:
    seen = [SharedView(board.points[depth.ids], depth.pixels.astype(np.float32),
                       color.pixels.astype(np.float32))
            for _, depth, color in map(_shared, views) if depth is not None and color is not None]
    of_depth, of_color = (
        [(board.points[corners.ids], corners.pixels) for corners in found if corners is not None]
        for found in ([view.depth for view in views], [view.color for view in views]))
    depth, color = calibrate_camera(of_depth, sizes[0]), calibrate_camera(of_color, sizes[1])
    try:
        _, _, _, _, _, R, T, _, _, rotations, shifts, _ = cv2.stereoCalibrateExtended(
            [view.points for view in seen], [view.depth for view in seen],
            [view.color for view in seen], depth.matrix, depth.distortion, color.matrix,
            color.distortion, sizes[0], np.eye(3), np.zeros(3), flags=cv2.CALIB_FIX_INTRINSIC)
    except cv2.error as error:
        raise CalibrationFailedError(f"the corners are those of no two cameras: {_ASK}") from error
    start = Rig(depth, color, np.concatenate([cv2.Rodrigues(R)[0].ravel(), np.ravel(T)]),
                np.array([np.concatenate([np.ravel(r), np.ravel(t)])
                          for r, t in zip(rotations, shifts, strict=True)]))
    # Both distortions can be inverted over the image; where they cannot be after the adjustment,
    # they stay.
    for distortion in (True, False):
        rig, accuracy = adjusted(start, seen, distortion=distortion)
        try:
            _calibration(rig, sizes)
        except ValueError:
            continue
        return _Fit(rig, accuracy, rig.errors(seen))
    raise CalibrationFailedError(f"the corners are those of no two cameras: {_ASK}")


def _calibration(rig: Rig, sizes: tuple[Size, Size]) -> Calibration:
    """Give the calibration; ValueError where it is none that can be."""
    return Calibration(
        depth=rig.depth.camera(sizes[0]), color=rig.color.camera(sizes[1]),
        depth_to_color=DepthToColor(
            rotation=Rotation.from_rotvec(rig.pose[:3]).as_matrix().tolist(),
            translation_mm=rig.pose[3:].tolist()))


def _rms(*errors: _Array) -> float:
    squares = np.concatenate([(error**2).sum(axis=1) for error in errors])
    return float(np.sqrt(squares.mean()))
