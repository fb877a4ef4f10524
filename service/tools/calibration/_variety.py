"""Whether views differ enough: a board that is always held alike leaves the focal length open."""

from collections.abc import Sequence

import cv2
import numpy as np

from denseface.service.errors import CalibrationFailedError
from denseface.service.tools.calibration._boards import Board
from denseface.service.tools.calibration._views import BoardView, Size

__all__ = ["check_variety"]

_LEAST_KINDS = 5
"""Views that differ."""
_ALIKE_SHARE = 0.04
"""Of the image's width: two views are alike whose corners are no further apart on average..."""
_ALIKE_DEG = 6.0
"""...and whose boards are tilted no more differently."""
_LEAST_TILT_DEG = 20.0
"""Between the two boards that are tilted most differently."""
_FOV_DEG = 60.0
"""Assumed, to tell tilts apart before the focal length is known."""


def check_variety(views: Sequence[BoardView], board: Board, size: Size) -> None:
    """Check what the depth camera sees.

    Raises
    ------
    CalibrationFailedError
        Says how many views differ, or how little the board was tilted, and what to do.
    """
    focal = size[0] / 2 / np.tan(np.radians(_FOV_DEG / 2))
    K = np.array([[focal, 0, (size[0] - 1) / 2], [0, focal, (size[1] - 1) / 2], [0, 0, 1]])
    normals, centers = [], []
    for corners in (view.depth for view in views if view.depth is not None):
        _, rotation, _ = cv2.solvePnP(board.points[corners.ids], corners.pixels, K, None,
                                      flags=cv2.SOLVEPNP_IPPE)
        normals.append(cv2.Rodrigues(rotation)[0][:, 2])
        centers.append(np.concatenate([corners.pixels.mean(axis=0), corners.pixels.std(axis=0)]))
    cosines = np.clip(np.abs(np.array(normals) @ np.array(normals).T), 0, 1)
    tilts = np.degrees(np.arccos(cosines))
    apart = np.abs(np.array(centers)[:, None] - np.array(centers)).max(axis=2) / size[0]
    kinds: list[int] = []
    for number in range(len(normals)):
        if all(tilts[number, other] > _ALIKE_DEG or apart[number, other] > _ALIKE_SHARE
               for other in kinds):
            kinds.append(number)
    advice = "hold the board near and far, in all corners, tilted by 20 to 40 degrees to each side"
    if len(kinds) < _LEAST_KINDS:
        raise CalibrationFailedError(f"the {len(views)} views are of {len(kinds)} kinds, expected "
                                     f"{_LEAST_KINDS} that differ: {advice}")
    if tilts.max() < _LEAST_TILT_DEG:
        raise CalibrationFailedError(
            f"the board is tilted by {tilts.max():.0f} degrees at most, expected "
            f"{_LEAST_TILT_DEG:.0f} or more: {advice}")
