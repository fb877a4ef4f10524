"""Where the seeds support a surface: over them and the holes they enclose, not past their rim."""

import math
from dataclasses import dataclass, replace
from typing import Self

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.errors import ImpossibleFrameError
from denseface.recon.numerics.bilinear import exceeds
from denseface.recon.numerics.filters import blurred
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.morphology import binary_fill_holes, dilated, disc, eroded
from denseface.recon.numerics.scatter import occupancy, xy_bounds

__all__ = ["Support"]

_FINENESS = 2
"""Points of the grid for each mean spacing."""
_CLOSING = 1.2
"""Half the width of gaps that are closed, mean spacings."""
_RIM = 0.2
"""How far outside of the outermost seeds the support ends, mean spacings."""
_EVEN = 4.0
"""Standard deviation of the Gaussian that evens out the outline, mean spacings: the sensor leaves
an edge frayed over several pixels."""
_EVEN_PART = 0.1
"""Where seeds are few: the same, at most, as a part of the side of a square of their area."""
_EVEN_PX = 3
"""The same, in pixels of the image that is filtered; more change nothing."""
_GROWTH = 1.0
"""How far the support may grow into bays of the outline, mean spacings."""
_NARROW_MM = 5.5
"""Narrower tongues of the support go, and narrower bays are closed: 5 mm, and what a grid may
be off."""
_NARROW_PART = 0.08
"""Where seeds are few: half of that width, at most, as a part of the side of a square of their
area."""
_ISLAND_SHARE = 0.15
"""What a cut leaves beside the largest part goes below this share of its area: an ear, or hair."""

_MAX_PLACES = 2**25
"""Of a grid; a face of a million seeds has a third of it."""


@dataclass(frozen=True, eq=False)
class Support:
    """The region over the seeds, with enclosed holes but nothing past the rim.

    Attributes
    ----------
    xs, ys : (columns,), (rows,) float64, mm, a grid of two points for each spacing
    step : distance of its points, mm
    seeded : (rows, columns) uint8, 1 at the points nearest to the seeds, 0 elsewhere
    margin : (rows, columns) float32, above 0 at supported points, above `level` between points
    level : not 0, since a disc of few pixels reaches farther than its radius
    """

    xs: Doubles
    ys: Doubles
    step: float
    seeded: Bytes
    margin: Floats
    level: float

    @classmethod
    def of(cls, points: Floats, spacing: float) -> Self:
        """Find where seeds, (n, 3) float32, mm, of a mean spacing, mm, support a surface.

        ImpossibleFrameError where that is larger than any face by far.
        """
        step = spacing / _FINENESS
        reach = (_CLOSING + _GROWTH) * spacing
        left, right, top, bottom = xy_bounds(points)
        xs, ys = _axes((left - reach, right + reach), (top - reach, bottom + reach), step)
        seeded = occupancy(points, (xs[0], ys[0]), step, len(ys), len(xs))
        around = disc(_CLOSING * _FINENESS)
        closed = binary_fill_holes(np.asarray(cv2.dilate(seeded, around), np.uint8))
        even = min(_EVEN * _FINENESS, _EVEN_PART * math.sqrt(np.count_nonzero(closed)))
        # What of a Gaussian centred so far inside a straight edge lies inside.
        least, pixels = (0.5 + 0.5 * math.erf((closing - _RIM * _FINENESS) / (even * math.sqrt(2)))
                         for closing in (_CLOSING * _FINENESS,
                                         math.sqrt(np.count_nonzero(around) / math.pi)))
        margin = _broadly_blurred(closed, even) - np.float32(least)
        most = cv2.dilate(closed, disc(_GROWTH * _FINENESS))
        grown = cls(xs, ys, step, seeded, margin, pixels - least).without(most == 0)
        return grown._evened()

    def _evened(self) -> Self:
        """Give the support with what it encloses, and without narrow bays and tongues.

        It encloses bays, too, whose mouth is evened out.
        """
        above = (self.margin > self.level).view(np.uint8)
        radius = _narrow(above, self.step)
        wide = np.pad(above, radius)
        # Closed, then opened.
        broad = dilated(eroded(dilated(wide, radius), 2 * radius), radius)
        rows, columns = above.shape
        whole = binary_fill_holes(broad)[radius:radius + rows, radius:radius + columns]
        return self.including(whole > above).without(above > whole)

    def without_holes(self) -> Self:
        """Give the support with what it encloses."""
        above = (self.margin > self.level).view(np.uint8)
        enclosed = binary_fill_holes(above) > above
        return self.including(enclosed) if enclosed.any() else self

    @property
    def inside(self) -> Bools:
        """Which of the grid's points are supported, (rows, columns)."""
        return self.margin > 0

    @property
    def area(self) -> float:
        """Area of the supported points, mm^2."""
        return float(np.count_nonzero(self.inside) * self.step**2)

    def near_seeds(self, radius: float) -> Bytes:
        """Which of the grid's points have a seed within a radius, mm; 0 or 1."""
        return np.asarray(cv2.dilate(self.seeded, disc(radius / self.step)), np.uint8)

    def without(self, removed: Bools) -> Self:
        """Remove some of the grid's points, up to half of the way to the next."""
        return replace(self, margin=_without(self.margin, removed, self.level))

    def cut(self, removed: Bools) -> Self:
        """Remove some of the grid's points, and what that leaves of tongues and islands."""
        left = self.without(removed)
        above = (left.margin > self.level).view(np.uint8)
        radius = _narrow(above, self.step)
        broad = dilated(eroded(binary_fill_holes(above), radius), radius)
        count, parts = cv2.connectedComponents(broad)
        if count <= 2:
            return left
        areas = np.bincount(parts.ravel())
        dropped = areas < _ISLAND_SHARE * areas[1:].max(initial=0)
        dropped[0] = True
        return left.without(dropped[parts] & (above > 0))

    def including(self, added: Bools) -> Self:
        """Add some of the grid's points."""
        # Twice the level: what lies between two points that are above it is so, too.
        return replace(self, margin=np.where(added, np.float32(2 * self.level), self.margin))

    def coordinates(self, xs: Doubles, ys: Doubles) -> tuple[Floats, Floats]:
        """Turn x and y, (k,), (m,) mm, into fractional columns and rows, clipped to the grid."""
        columns, rows = (
            np.clip((values - own[0]) / self.step, 0, len(own) - 1).astype(np.float32)
            for values, own in ((xs, self.xs), (ys, self.ys)))
        return columns, rows

    def on_grid(self, step: float) -> tuple[Doubles, Doubles, Bools]:
        """Sample on a grid of another step, mm, over the same region.

        Returns xs, ys, (columns,), (rows,) float64, mm, and the support, (rows, columns) bool.
        """
        xs, ys = self.axes(step)
        return xs, ys, self.sampled(xs, ys)

    def axes(self, step: float) -> tuple[Doubles, Doubles]:
        """Give x and y, mm, of the columns and rows of another grid over the same region."""
        return _axes((self.xs[0], self.xs[-1]), (self.ys[0], self.ys[-1]), step)

    def sampled(self, xs: Doubles, ys: Doubles) -> Bools:
        """Say which points of a grid are supported: (k,), (m,) mm, to (m, k)."""
        columns, rows = self.coordinates(xs, ys)
        return exceeds(self.margin, rows, columns, self.level)


def _narrow(mask: Bytes, step: float) -> int:
    """Give the radius, points of the grid, of the disc into which what is narrow does not go."""
    return int(min(_NARROW_MM / 2 / step, _NARROW_PART * math.sqrt(np.count_nonzero(mask))))


def _broadly_blurred(image: Bytes, sigma: float) -> Floats:
    """Blur by a broad Gaussian, on fewer pixels where they are enough."""
    every = max(1, int(sigma / _EVEN_PX))
    rows, columns = (-(-side // every) for side in image.shape)
    whole = cv2.copyMakeBorder(
        image.astype(np.float32), 0, rows * every - image.shape[0], 0,
        columns * every - image.shape[1], cv2.BORDER_CONSTANT, value=0)
    small = np.asarray(
        cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA), np.float32)
    broad = blurred(small, sigma / every)
    return np.asarray(cv2.resize(broad, whole.shape[::-1], interpolation=cv2.INTER_LINEAR),
                      np.float32)[:image.shape[0], :image.shape[1]]


def _axes(
    x_range: tuple[float, float], y_range: tuple[float, float], step: float
) -> tuple[Doubles, Doubles]:
    """Points along x and y from the low ends to beyond the high ones, of an even number each."""
    width, height = x_range[1] - x_range[0], y_range[1] - y_range[0]
    if not (step > 0 and (width / step) * (height / step) <= _MAX_PLACES):
        raise ImpossibleFrameError(
            f"the face is {width:.6g} x {height:.6g} mm with points every {step:.6g} mm: more than "
            f"{_MAX_PLACES} points: is the calibration right?")
    xs, ys = (low + step * np.arange(2 * (int(side / step) // 2 + 1), dtype=np.float64)
              for low, side in ((x_range[0], width), (y_range[0], height)))
    return xs, ys


@compiled
def _without(margin: Floats, removed: Bools, level: float) -> Floats:
    """Give a support's margin without some points."""
    flat, out = margin.ravel(), np.empty(margin.shape, np.float32)
    mask, given, middle = removed.ravel(), out.ravel(), np.float32(level)
    for i in range(np.uint64(len(flat))):
        value = flat[i]
        less = min(middle - abs(value - middle), np.float32(0))
        given[i] = less if mask[i] else value
    return out
