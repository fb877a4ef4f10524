"""Boards with corners that a camera finds: checkerboards and ChArUco boards."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["Board", "Charuco", "Checkerboard", "Corners"]

_SUBPIX_WINDOW = (2, 11)
"""Half the side of the window in which a corner is refined, pixels, least and most."""
_WINDOW_SHARE, _CHARUCO_SHARE = 0.35, 0.13
"""Of the distance to the nearest corner: further the window would hold another corner's edges, or
those of a marker, which is three quarters as wide as its square."""
_SUBPIX_END = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 60, 1e-4)
_LEAST_CORNERS = 8
"""Of a ChArUco board that is partly seen; four would fit any tilt."""


class Corners(NamedTuple):
    """Corners found in one image."""

    ids: NDArray[np.int64]
    """(n,), rising."""
    pixels: NDArray[np.float64]
    """(n, 2), (u, v); (0, 0) is the centre of the top left pixel."""


class Board(Protocol):
    """A flat board whose corners have numbers."""

    @property
    def points(self) -> NDArray[np.float32]:
        """(n, 3), mm, on the board; z = 0."""

    def find(self, image: NDArray[np.uint8]) -> Corners | None:
        """Find the corners in a grey image (H, W), to a fraction of a pixel."""


@dataclass(frozen=True)
class Checkerboard:
    """A checkerboard, which is found where all of it is seen."""

    columns: int
    rows: int
    """Inner corners."""
    square_mm: float

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """Row by row, from 0."""
        return _grid(self.columns, self.rows, self.square_mm)

    def find(self, image: NDArray[np.uint8]) -> Corners | None:
        """As `Board` says; the first corner is at either end where the board looks the same so."""
        size = (self.columns, self.rows)
        found, corners = cv2.findChessboardCorners(
            image, size, flags=cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
            | cv2.CALIB_CB_FAST_CHECK)
        if not found:  # slower, and finds boards that are blurred or unevenly lit
            found, corners = cv2.findChessboardCornersSB(
                image, size, flags=cv2.CALIB_CB_NORMALIZE_IMAGE)
        if not found:
            return None
        pixels = _refined(image, corners)
        return Corners(np.arange(len(pixels)), pixels)


@dataclass(frozen=True)
class Charuco:
    """A checkerboard with markers in its white squares, of which a part is enough."""

    columns: int
    rows: int
    """Squares."""
    square_mm: float
    marker_mm: float
    dictionary: str
    """Name of OpenCV's, such as `4X4_50`."""

    @cached_property
    def points(self) -> NDArray[np.float32]:
        """Of the inner corners, by OpenCV's numbers."""
        return _grid(self.columns - 1, self.rows - 1, self.square_mm)

    def find(self, image: NDArray[np.uint8]) -> Corners | None:
        """As `Board` says; boards that OpenCV drew before version 4.6 are found too."""
        best: Corners | None = None
        for board in self._boards:
            corners, ids, _, _ = cv2.aruco.CharucoDetector(board).detectBoard(image)
            if ids is not None and len(ids) > len(best.ids if best else ()):
                order = np.argsort(ids.ravel())
                best = Corners(ids.ravel()[order].astype(np.int64),
                               corners.reshape(-1, 2)[order].astype(np.float64))
        if best is None or len(best.ids) < _LEAST_CORNERS:
            return None
        return best._replace(pixels=_refined(image, best.pixels, _CHARUCO_SHARE))

    @cached_property
    def _boards(self) -> list[cv2.aruco.CharucoBoard]:
        name = f"DICT_{self.dictionary.upper().removeprefix('DICT_')}"
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, name))
        boards = []
        for legacy in (False, True):
            board = cv2.aruco.CharucoBoard(
                (self.columns, self.rows), self.square_mm, self.marker_mm, dictionary)
            board.setLegacyPattern(legacy)
            boards.append(board)
        return boards


def _grid(columns: int, rows: int, square_mm: float) -> NDArray[np.float32]:
    points = np.zeros((rows * columns, 3), np.float32)
    points[:, :2] = np.mgrid[:columns, :rows].T.reshape(-1, 2) * square_mm
    return points


def _refined(
    image: NDArray[np.uint8], corners: NDArray[Any], share: float = _WINDOW_SHARE
) -> NDArray[np.float64]:
    """Move corners to where the edges around them cross (Förstner)."""
    pixels = np.ascontiguousarray(corners, np.float32).reshape(-1, 1, 2)
    gaps = np.linalg.norm(pixels - pixels.reshape(1, -1, 2), axis=2)
    np.fill_diagonal(gaps, np.inf)
    half = int(np.clip(round(gaps.min() * share), *_SUBPIX_WINDOW))
    return cv2.cornerSubPix(image, pixels, (half, half), (-1, -1), _SUBPIX_END
                            ).reshape(-1, 2).astype(np.float64)
