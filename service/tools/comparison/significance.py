"""Which differences of two faces are more than their noise: places, sizes, intervals.

Differences over their standard error are averaged under Gaussians of several widths; the largest
average over all places and widths is compared with that of noise alone, drawn with the correlation
that the differences themselves show. So the chance of any false statement about a face, not about a
place, is what is promised (the maximum statistic: Nichols and Hayasaka, 2003,
doi:10.1191/0962280203sm341ra; several widths: Poline and Mazoyer, 1994, doi:10.1109/42.363096).

How large the noise is, is told by the median absolute difference over the face, as most of a face
stays: sigma, which holds what every face of a head has in common, too, gives its shape alone. What
repeats of unchanged heads show beyond that model is in `_TAIL`, `_SINGLE_TAIL` and `_FLOOR_MM`,
chosen on heads and sensors of the simulator (docs/decisions/0060-what-changed-in-a-face.md).
"""

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.special import erfinv

from denseface.service.tools.comparison.smoothing import Blur, NullFields, null_fields

__all__ = ["Change", "Differences", "Verdict", "judge"]

_Doubles: TypeAlias = NDArray[np.float64]

_SCALES_MM = (5.0, 8.0, 12.0)
"""Of the averages: changes 12 to 30 mm wide are seen best."""
_LENGTH_MM = (2.5, 9.0)
"""Bounds of the length over which noise is alike, standard deviation."""
_TAIL, _SINGLE_TAIL = 1.4, 1.55
"""By how much repeats exceed what Gaussian noise would: factors of the threshold, where the scatter
of several captures tells how steady each place is, and where it does not."""
_SEVERAL = 4
"""Degrees of freedom from which on it does."""
_FLOOR_MM = 0.05
"""Standard error that no average takes away: cameras, pose, skin that breathes."""
_PRIOR_FREEDOM = 4.0
"""Weight of sigma's shape against the scatter of the captures of a side, degrees of freedom."""
_SCATTER_MM = 10.0
"""Over so much the captures' scatter is averaged."""
_JOINED_MM = 6.0
"""Places nearer than this are of one region."""
_TYPICAL_MM = 20.0
"""Width, at half its height, of the change that `Verdict.finds_mm` is said of."""
_FEWEST = 100
"""With fewer places there is nothing to say."""


@dataclass(frozen=True, eq=False)
class Differences:
    """What is compared, place by place.

    Attributes
    ----------
    points : (n, 3) float64, mm, frame of the first face
    difference : (n,) float64, mm, along the normals; NaN where it is not known
    sigma : (n,) float64, mm, its standard error as the faces say it
    scatter : (n,) float64, mm, its standard error by the scatter of the captures on each side; NaN
        where there are none
    freedom : degrees of freedom of that
    judged : (n,) bool, where something is to be said
    """

    points: _Doubles
    difference: _Doubles
    sigma: _Doubles
    scatter: _Doubles
    freedom: int
    judged: NDArray[np.bool_]


class Change(NamedTuple):
    """A region that changed."""

    peak: int
    """Its place: the row where it is surest."""
    rows: NDArray[np.int64]
    """All its places."""
    mean_mm: float
    """Mean difference over it; positive outward."""
    half_mm: float
    """Half of that mean's interval at the confidence asked for."""
    peak_mm: float
    """Largest averaged difference."""
    area_mm2: float
    width_mm: float
    """Diameter of the disc as large as what has half of the peak's difference or more."""
    score: float
    """Its surest average in standard deviations, over the threshold: more than 1."""


@dataclass(frozen=True, eq=False)
class Verdict:
    """What can be said of a face.

    Attributes
    ----------
    confidence : chance that nothing is stated of a face that did not change
    changes : the surest first
    score : (n,) float64, largest average over the threshold, with the difference's sign; NaN where
        nothing is said
    noise_mm : median standard error of a difference at one place
    length_mm : over so much it is alike: standard deviation of the Gaussian that makes white noise
        so
    finds_mm : how high a smooth change must be, 20 mm wide at half its height, to be found 9 times
        in 10: the median over the places
    """

    confidence: float
    changes: tuple[Change, ...]
    score: _Doubles
    noise_mm: float
    length_mm: float
    finds_mm: float


def judge(given: Differences, confidence: float) -> Verdict | None:
    """Say where a face changed; None where too little of it can be compared."""
    known = given.judged & np.isfinite(given.difference)
    if known.sum() < _FEWEST:
        return None
    error = _standard_error(given, known)
    relative = np.where(known, given.difference / error, 0.0)
    scale = max(_deviation(relative[known]), 1e-6)
    blurs = [Blur(given.points, width) for width in _SCALES_MM]
    means = [blur.mean(relative, known) for blur in blurs]
    length = _length(means, known, scale)
    null = null_fields(given.points, known, length, blurs)
    tail = _TAIL if given.freedom >= _SEVERAL else _SINGLE_TAIL
    threshold = tail * null.threshold(confidence)
    scores, scales = [], []
    for mean, deviation in zip(means, null.deviation, strict=True):
        standard = np.where(known, mean / deviation, 0.0)
        # Noise that is alike farther than the model has more left in a wide average.
        scales.append(max(scale, _deviation(standard[known])))
        scores.append(standard / (scales[-1] * threshold))
    stack = np.array(scores)
    surest = np.abs(stack).argmax(axis=0)
    score = np.take_along_axis(stack, surest[None], axis=0)[0]
    places = _Places(given, known, blurs, null, error * scale, stack, score)
    changes = tuple(sorted((places.change(rows, confidence) for rows in places.regions()),
                           key=lambda change: -change.score))
    return Verdict(
        confidence, changes, np.where(known, score, np.nan),
        float(np.median((error * scale)[known])), length,
        _finds(error, known, blurs, null, scales, threshold))


def _standard_error(given: Differences, known: NDArray[np.bool_]) -> _Doubles:
    """Give the shape of the differences' standard error, (n,) mm."""
    error = np.where(known, np.nan_to_num(given.sigma), 0.0)
    if not error.any():  # the files have none: all places alike
        error = np.full(len(error), max(_deviation(given.difference[known]), 1e-6))
    usual = float(np.median(error[known]))
    # Where sigma is large, at rims, wings of the nose, lips, repeats differ by more than it says.
    error = error * np.clip(error / usual, 1, 3)
    scatter = known & np.isfinite(given.scatter)
    if given.freedom > 0 and scatter.sum() > _FEWEST:
        blur = Blur(given.points, _SCATTER_MM)
        seen = blur.mean(np.where(scatter, given.scatter**2, 0.0), scatter)
        ratio = seen / np.maximum(blur.mean(error**2, scatter), 1e-12)
        ratio /= max(float(np.median(ratio[scatter])), 1e-12)
        error = error * np.sqrt((_PRIOR_FREEDOM + given.freedom * ratio)
                                / (_PRIOR_FREEDOM + given.freedom))
    return np.hypot(np.maximum(error, 1e-6), _FLOOR_MM)


def _deviation(values: _Doubles) -> float:
    """Give the standard deviation by the median, about zero, so that few outliers do not count."""
    return float(1.4826 * np.median(np.abs(values)))


def _length(means: list[_Doubles], known: NDArray[np.bool_], scale: float) -> float:
    """Tell over what length noise is alike, by what averages leave of it, mm.

    White noise under a Gaussian of l, averaged over one of s, keeps l / root(l^2 + s^2).
    """
    found = []
    for mean, width in zip(means[:2], _SCALES_MM, strict=False):
        left = min(_deviation(mean[known]) / scale, 0.95)
        found.append(width * left / np.sqrt(1 - left**2))
    return float(np.clip(np.mean(found), *_LENGTH_MM))


def _finds(
    error: _Doubles, known: NDArray[np.bool_], blurs: list[Blur], null: NullFields,
    scales: list[float], threshold: float,
) -> float:
    """Give the height of a smooth change that would be found 9 times in 10, mm."""
    wide = _TYPICAL_MM / 2.355
    best = np.full(int(known.sum()), np.inf)
    for blur, deviation, scale in zip(blurs, null.deviation, scales, strict=True):
        kept = wide**2 / (wide**2 + blur.scale_mm**2)
        local = scale * deviation * error
        best = np.minimum(best, (threshold + 1.28) * local[known] / kept)
    return float(np.median(best))


@dataclass(frozen=True, eq=False)
class _Places:
    given: Differences
    known: NDArray[np.bool_]
    blurs: list[Blur]
    null: NullFields
    error: _Doubles
    stack: _Doubles
    score: _Doubles

    def regions(self) -> list[NDArray[np.int64]]:
        """Give the places of each region beyond the threshold, each of one sign."""
        found = []
        for sign in (1, -1):
            beyond = np.flatnonzero(self.known & (sign * self.score >= 1))
            if len(beyond):
                count, labels = self._parts(beyond)
                found += [beyond[labels == k] for k in range(count)]
        return found

    def change(self, rows: NDArray[np.int64], confidence: float) -> Change:
        """Say how large a region and its change are."""
        peak = int(rows[np.abs(self.score[rows]).argmax()])
        fine = self.blurs[0]
        averaged = fine.mean(np.where(self.known, self.given.difference, 0.0), self.known)
        area = 2 * np.pi * fine.scale_mm**2 / np.maximum(
            fine.sums(self.known.astype(float)), 1.0)
        top = rows[np.abs(averaged[rows]).argmax()]
        half = self._around(top, np.sign(averaged[top]) * averaged >= abs(averaged[top]) / 2)
        weight = area[rows] / area[rows].sum()
        noise = weight @ (self.error[rows, None] * self.null.fields[rows])
        times = np.sqrt(2) * erfinv(confidence)
        return Change(
            peak, rows, float(weight @ self.given.difference[rows]), float(times * noise.std()),
            float(averaged[top]), float(area[rows].sum()),
            float(2 * np.sqrt(area[half].sum() / np.pi)), float(abs(self.score[peak])))

    def _around(self, top: int, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Give the chosen places that hang together with one of them."""
        rows = np.flatnonzero(chosen & self.known)
        _, labels = self._parts(rows)
        return np.asarray(rows[labels == labels[np.searchsorted(rows, top)]], np.int64)

    def _parts(self, rows: NDArray[np.int64]) -> tuple[int, NDArray[np.int32]]:
        """Give how many parts some places fall into, and which one each is of."""
        pairs = cKDTree(self.given.points[rows]).query_pairs(_JOINED_MM, output_type="ndarray")
        graph = sparse.coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])),
                                 shape=(len(rows), len(rows)))
        count, labels = connected_components(graph, directed=False)
        return count, labels
