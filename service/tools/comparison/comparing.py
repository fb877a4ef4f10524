"""Two sides, each of one capture of a face or several, to one comparison."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from denseface.service.errors import ServiceError
from denseface.service.tools.comparison.alignment import Alignment, align
from denseface.service.tools.comparison.differences import SITE_MM, distances, sites_of
from denseface.service.tools.comparison.regions import HeadPlace, region_name
from denseface.service.tools.comparison.significance import Differences, Verdict, judge
from denseface.service.tools.comparison.smoothing import Blur
from denseface.service.tools.comparison.surface import Surface

__all__ = ["Comparison", "LaidOn", "Numbers", "compare_surfaces"]

_RIM_MM, _OFF_MM = 6.0, 1.5
"""A place is at the rim where the middle of what is known around it, under a Gaussian of `_RIM_MM`,
lies farther from it than `_OFF_MM`."""
_STEEP = 0.4
"""Where a surface is seen under a smaller cosine, its depth says little."""
_FACE_Y, _FACE_X = (-80.0, 88.0), 75.0
"""Hair, ears and neck are not judged: bounds in the mean face's units."""
_SURE = 0.5
"""Score below which what is compared is no face for sure."""


@dataclass(frozen=True)
class Numbers:
    """Figures of signed differences, mm; positive where the second face stands out."""

    places: int
    mean_mm: float
    median_mm: float
    rms_mm: float
    within_95_mm: float
    """95 % of the places differ by no more."""
    beyond: float
    """Share that differs by more than `beyond_mm`."""
    beyond_mm: float

    @classmethod
    def of(cls, values: NDArray[np.float64], beyond_mm: float) -> "Numbers":
        """Give the figures of values, (n,) mm, n > 0."""
        return cls(len(values), float(values.mean()), float(np.median(values)),
                   float(np.sqrt((values**2).mean())), float(np.percentile(np.abs(values), 95)),
                   float((np.abs(values) > beyond_mm).mean()), beyond_mm)


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two faces laid on each other.

    Attributes
    ----------
    sites : where they are compared, in the frame of the first side's first capture
    difference : (n,) float64, mm along the sites' normals, NaN where a side has nothing
    places : (n, 3) float64, the sites in the mean face's frame
    names : (n,) str, what part of the face each site is on
    numbers : of all differences
    verdict : where the face changed; None where too little can be told
    aligned : how each capture lies on the first one, first side's first; None of that one itself
    place : of the head on the first capture
    warnings : what is odd, a line each
    """

    sites: Surface
    difference: NDArray[np.float64]
    places: NDArray[np.float64]
    names: NDArray[np.str_]
    numbers: Numbers
    verdict: Verdict | None
    aligned: tuple[Alignment | None, ...]
    place: HeadPlace
    warnings: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class LaidOn:
    """Captures laid on the first of them.

    Attributes
    ----------
    sites : where they are compared, in the first one's frame
    place : of the head in it
    distance : (captures, n) float64, mm, how far each stands out of the first one at the sites,
        along their normals; NaN where it is not
    sigma : (captures, n) float64, mm, its standard errors there
    aligned : how each lies on the first one; None of that one itself
    names : of the captures
    warnings : what is odd, a line each
    """

    sites: Surface
    place: HeadPlace
    distance: NDArray[np.float64]
    sigma: NDArray[np.float64]
    aligned: tuple[Alignment | None, ...]
    names: tuple[str, ...]
    warnings: tuple[str, ...]

    @classmethod
    def of(
        cls, surfaces: Sequence[Surface], names: Sequence[str],
        done: Callable[[], object] = lambda: None, *, apart_mm: float = SITE_MM,
    ) -> Self:
        """Lay captures, each in its own camera's frame, on the first.

        names : of all, for errors; done : called after each; apart_mm : distance of the sites

        Raises
        ------
        ServiceError
            One has no face, or cannot be laid on the first.
        """
        reference = surfaces[0]
        sites, head = sites_of(reference, apart_mm), _placed(reference, names[0])
        shape = len(surfaces), len(sites)
        found, sigma = np.zeros(shape), np.zeros(shape)
        sigma[0] = sites.sigma
        aligned: list[Alignment | None] = [None]
        warnings = [] if head.score >= _SURE else [_doubt(names[0], head)]
        done()
        for index in range(1, len(surfaces)):
            surface, name = surfaces[index], names[index]
            place = _placed(surface, name)
            if place.score < _SURE:
                warnings.append(_doubt(name, place))
            laid = align(surface, reference, place=head, start=head.pose @ place.pose.inverse)
            if laid is None:
                raise ServiceError(f"{name}: too little of it lies on {names[0]}: are both faces, "
                                   "in millimetres?")
            aligned.append(laid)
            found[index], sigma[index] = distances(surface.moved(laid.pose), sites)
            done()
        return cls(sites, head, found, sigma, tuple(aligned), tuple(names), tuple(warnings))

    def compare(
        self, before: Sequence[int], after: Sequence[int], *, confidence: float = 0.95,
        beyond_mm: float = 1.0,
    ) -> Comparison:
        """Compare two sides, each some of the captures by number.

        confidence : that nothing is stated of a face that did not change

        Raises
        ------
        ServiceError
            No place is on both sides.
        """
        one, other = (_Side.of(self.distance[list(rows)], self.sigma[list(rows)])
                      for rows in (before, after))
        difference = other.mean - one.mean
        known = np.isfinite(difference)
        if not known.any():
            raise ServiceError(f"{self.names[after[0]]}: nothing of it lies on "
                               f"{self.names[before[0]]}: are both faces, in millimetres?")
        own = self.place.own(self.sites.points)
        verdict = judge(Differences(
            self.sites.points, difference, np.hypot(one.sigma, other.sigma),
            _scatter(one, other), len(before) + len(after) - 2,
            known & _judged(self.sites, known, own)), confidence)
        return Comparison(
            self.sites, difference, own, np.array([region_name(place) for place in own]),
            Numbers.of(difference[known], beyond_mm), verdict, self.aligned, self.place,
            self.warnings)


def compare_surfaces(
    before: Sequence[Surface], after: Sequence[Surface], *, confidence: float = 0.95,
    beyond_mm: float = 1.0, names: Sequence[str] = (), done: Callable[[], object] = lambda: None,
) -> Comparison:
    """Compare two sides, each of captures in their own cameras' frames.

    Raises
    ------
    ServiceError
        As `LaidOn`.
    """
    every = [*before, *after]
    names = names or [f"capture {number}" for number in range(len(every))]
    laid = LaidOn.of(every, names, done)
    split = len(before)
    return laid.compare(range(split), range(split, len(every)), confidence=confidence,
                        beyond_mm=beyond_mm)


def _doubt(name: str, place: HeadPlace) -> str:
    return f"{name}: not surely a face (score {place.score:.2f})"


def _placed(surface: Surface, name: str) -> HeadPlace:
    place = HeadPlace.find(surface)
    if place is None:
        raise ServiceError(f"{name}: has no face that looks toward -z, y down, in millimetres")
    return place


@dataclass(frozen=True, eq=False)
class _Side:
    mean: NDArray[np.float64]
    sigma: NDArray[np.float64]
    """Of the mean, by the faces' own."""
    squares: NDArray[np.float64]
    """Of the deviations from the mean, summed."""
    count: NDArray[np.int64]

    @classmethod
    def of(cls, found: NDArray[np.float64], sigma: NDArray[np.float64]) -> "_Side":
        there = np.isfinite(found)
        count = there.sum(axis=0)
        enough = 2 * count >= max(len(found), 1)
        number = np.maximum(count, 1)
        mean = np.where(there, found, 0).sum(axis=0) / number
        squares = (np.where(there, found - mean, 0) ** 2).sum(axis=0)
        error = np.sqrt((np.where(there, sigma, 0) ** 2).sum(axis=0)) / number
        return cls(np.where(enough & (count > 0), mean, np.nan), error, squares, count)


def _scatter(one: _Side, other: _Side) -> NDArray[np.float64]:
    """Give the standard error of the difference by what the captures of each side differ, (n,)."""
    freedom = one.count + other.count - 2
    variance = (one.squares + other.squares) / np.maximum(freedom, 1)
    spread = 1 / np.maximum(one.count, 1) + 1 / np.maximum(other.count, 1)
    return np.where(freedom > 0, np.sqrt(variance * spread), np.nan)


def _judged(
    sites: Surface, known: NDArray[np.bool_], own: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Say where differences are judged: on the face, away from its rim, where it is not steep."""
    rays = sites.points / np.linalg.norm(sites.points, axis=1, keepdims=True)
    facing = -(rays * sites.normals).sum(axis=1) > _STEEP
    face = ((own[:, 1] > _FACE_Y[0]) & (own[:, 1] < _FACE_Y[1]) & (np.abs(own[:, 0]) < _FACE_X))
    middle = Blur(sites.points, _RIM_MM).mean(sites.points, known)
    inside = np.linalg.norm(middle - sites.points, axis=1) < _OFF_MM
    return np.asarray(facing & face & inside)
