"""Where a depth image breaks off: the outlines of what stands before something farther."""

from dataclasses import dataclass
from typing import NamedTuple, Self

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["Outlines", "find_outlines"]

_STEP_SHARE = 0.05
"""Least step in depth at an outline, as a share of the nearer depth."""
_RANGE_MM = (300.0, 5000.0)
"""Nearer or farther outlines are not used: noise is a step there."""
_GAP_SHARE = 1 / 8
"""Widest unmeasured gap in an outline by the image's width: a shadow has up to 70 of 640 pixels.
Beyond a wider one nothing is known, and the outline is that of what was measured."""
_SPECKLES_PX = 5
"""Side of the median that takes away specks of noise, which have outlines too."""
_LINES = (240, 320)
"""Rows and columns that are searched, about: every other one of a Kinect's."""
_MOST = 3000
"""Samples that are kept, evenly spread over all."""


@dataclass(frozen=True, eq=False)
class Outlines:
    """Samples of the outlines, on the border of the nearer surface.

    Attributes
    ----------
    pixels : (n, 2) float32, (u, v) in the depth image
    z_mm : (n,) float32, depth of the nearer surface
    upright : (n,) bool, whether the step was found along a row: the outline is rather vertical
    side : (n,) int8, 1 where what is behind is seen to the right or below, -1 to the left or above
    gap : (n,) int32, pixels without depth between the sample and what is behind
    behind_mm : (n,) float32, depth of what is behind, nan where nothing is
    """

    pixels: NDArray[np.float32]
    z_mm: NDArray[np.float32]
    upright: NDArray[np.bool_]
    side: NDArray[np.int8]
    gap: NDArray[np.int32]
    behind_mm: NDArray[np.float32]

    def __len__(self) -> int:
        return len(self.z_mm)

    def among(self, chosen: NDArray[np.bool_] | slice) -> "Outlines":
        """Give some of the samples."""
        return Outlines(self.pixels[chosen], self.z_mm[chosen], self.upright[chosen],
                        self.side[chosen], self.gap[chosen], self.behind_mm[chosen])


def find_outlines(depth: NDArray[np.uint16], unit_mm: float = 1.0) -> Outlines:
    """Sample the outlines of a depth image.

    Parameters
    ----------
    depth : (H, W) uint16, counts of `unit_mm`, 0 = no reading
    """
    smooth = np.asarray(cv2.medianBlur(depth, _SPECKLES_PX), np.uint16)
    down, across = (max(side // lines, 2) for side, lines in
                    zip(depth.shape, _LINES, strict=True))
    rows = _Steps.along_rows(smooth[::down], unit_mm)
    columns = _Steps.along_rows(np.ascontiguousarray(smooth[:, ::across].T), unit_mm)
    found = Outlines(
        np.concatenate([np.stack([rows.place, rows.line * down], axis=1),
                        np.stack([columns.line * across, columns.place], axis=1)]
                       ).astype(np.float32),
        np.concatenate([rows.z, columns.z]),
        np.arange(len(rows.z) + len(columns.z)) < len(rows.z),
        np.concatenate([rows.side, columns.side]), np.concatenate([rows.gap, columns.gap]),
        np.concatenate([rows.behind, columns.behind]))
    return found.among(slice(None, None, -(-len(found) // _MOST) or 1))


class _Steps(NamedTuple):
    """Steps in depth along the rows of an image, as in `Outlines`."""

    line: NDArray[np.intp]
    place: NDArray[np.float64]
    z: NDArray[np.float32]
    side: NDArray[np.int8]
    gap: NDArray[np.int32]
    behind: NDArray[np.float32]

    @classmethod
    def along_rows(cls, depth: NDArray[np.uint16], unit_mm: float) -> Self:
        widest = max(round(depth.shape[1] * _GAP_SHARE), 2)
        row, column = np.nonzero(depth > 0)
        z = depth[row, column].astype(np.float32) * np.float32(unit_mm)
        # From each measured pixel to the next of its row, and to the image's border at the ends.
        same = row[1:] == row[:-1]
        gap = np.where(same, column[1:] - column[:-1] - 1, 0)
        left, right = z[:-1], z[1:]
        step = same & (gap <= widest) & (
            np.abs(right - left) > _STEP_SHARE * np.minimum(left, right))
        at = np.flatnonzero(step)
        left_is_near = left[at] < right[at]
        index, side = [np.where(left_is_near, at, at + 1)], [np.where(left_is_near, 1, -1)]
        for alone, way in zip(_ends(row, column, depth.shape[1], widest), (1, -1), strict=True):
            index.append(alone)
            side.append(np.full(len(alone), way))
        nothing = sum(map(len, index[1:]))
        gaps = np.append(gap[at], np.zeros(nothing))
        behind = np.append(np.maximum(left, right)[at], np.full(nothing, np.nan))
        near, sides = np.concatenate(index), np.concatenate(side)
        kept = (z[near] > _RANGE_MM[0]) & (z[near] < _RANGE_MM[1])
        near, sides = near[kept], sides[kept]
        return cls(row[near], column[near] + 0.5 * sides, z[near], sides.astype(np.int8),
                   gaps[kept].astype(np.int32), behind[kept].astype(np.float32))


def _ends(
    row: NDArray[np.intp], column: NDArray[np.intp], width: int, widest: int
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give the measured pixels with nothing for a long way to the right, and to the left."""
    following = np.append(np.where(row[1:] == row[:-1], column[1:], width), width)
    before = np.insert(np.where(row[1:] == row[:-1], column[:-1], -1), 0, -1)
    return (np.flatnonzero(following - column > widest + 1),
            np.flatnonzero(column - before > widest + 1))
