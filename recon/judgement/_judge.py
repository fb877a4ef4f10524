"""Whether a surface has a face's shape: a score from 0 to 1, and in words what it is else."""

import math
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.intermediate import SurfaceGrid
from denseface.recon.judgement._likeness import Likeness, likenesses
from denseface.recon.judgement._placing import quick_placements
from denseface.recon.prior import HeadPose

__all__ = ["LEAST_SCORE", "SURE_SCORE", "Judgement", "judge_points", "judge_shape", "score_of",
           "score_quickly", "surface_points"]

_STEP_MM = 4.0
"""Distance of the points that are judged: the relief of a face is broader."""
_FEWEST_POINTS = 80
"""Fewer show no relief; the least that `check_face` lets pass are three times as many."""

_WEIGHTS = np.array((3.21, 2.25, 2.56, -3.74, -0.59, -1.60, -4.69))
_BIAS = 1.05
"""Of `Likeness.figures`, for the logarithm of the odds: a logistic regression, that of
`python -m bench.judgement`, on 197 faces of the choosing heads (the scenes of recall, hard ones,
such as are turned by 45 to 66 degrees, twelve sensors) and on 119 things that are none."""
LEAST_SCORE = 0.5
"""What has less is no face."""
SURE_SCORE = 0.9
"""What has less may be none, and a farther face that has more is taken instead. With that, no other
placement of the mean face is tried."""

_FLAT_RMS_MM, _SMOOTH_RMS_MM = 1.5, 2.5
"""What a plane, or a quadric, leaves of a flat thing, or a smooth one."""
_STRAIGHT = 0.25
"""Of the larger curvature: a smaller one along a tin."""


class Judgement(NamedTuple):
    """What a surface is.

    Attributes
    ----------
    score : how sure it is that it is a face's, 0-1, at least `LEAST_SCORE` for a face
    like : what it is like, in words; empty for a face
    placement : (13,), of the mean face on it, by `_mould_kernels`; None where that was not laid on
    """

    score: float
    like: str
    placement: Doubles | None

    @property
    def pose(self) -> HeadPose | None:
        """How the mean face lies on it; None where it was not laid on."""
        if self.placement is None:
            return None
        return HeadPose(self.placement[:9].reshape(3, 3).copy(), self.placement[9:12].copy())


def judge_shape(surface: SurfaceGrid) -> Judgement:
    """Say how sure it is that a surface is a face's.

    The mean face is laid on it. A face's eyes, nose and mouth then stand where the mean face's do:
    what a quadric leaves of both correlates, about 0.9; of tins, boxes and balls it does not.

    Parameters
    ----------
    surface : the fit over (X, Y), with its detail
    """
    return judge_points(surface_points(surface))


def judge_points(points: Doubles) -> Judgement:
    """Judge points of a surface, (n, 3) mm, `_STEP_MM` apart along x and y: see `judge_shape`."""
    if len(points) < _FEWEST_POINTS:
        return Judgement(0.0, "too small", None)
    best, placement = 0.0, None
    for likeness in likenesses(points):
        score = score_of(likeness)
        if placement is None or score > best:
            best, placement = score, likeness.placement
        if best >= SURE_SCORE:
            break
    return Judgement(best, "" if best >= LEAST_SCORE else _what_it_is(points), placement)


def score_quickly(points: Doubles) -> float:
    """Say how sure it is that raw points are of a face, (n, 3) mm, about a head's middle: 0-1.

    By fewer placements than `judge_shape`, and none once `LEAST_SCORE` is reached: as a first test,
    of which a low threshold means something, on the readings of a part of a frame.
    """
    best = 0.0
    if len(points) >= _FEWEST_POINTS:
        for likeness in likenesses(points, quick_placements):
            best = max(best, score_of(likeness))
            if best >= LEAST_SCORE:
                break
    return best


def surface_points(surface: SurfaceGrid) -> Doubles:
    """Give the points that are judged, (n, 3) mm."""
    xs, ys, inside = surface.support.on_grid(_STEP_MM)
    rows, columns = np.nonzero(inside)
    return np.stack([xs[columns], ys[rows], surface.sampled(xs, ys)[0][rows, columns]],
                    axis=-1).astype(np.float64)


def score_of(likeness: Likeness) -> float:
    """Give the probability that it is a face's, were six faces to four other things."""
    return 1 / (1 + math.exp(-float(_WEIGHTS @ likeness.figures + _BIAS)))


def _what_it_is(points: Doubles) -> str:
    """Say what the front half of a surface, (n, 3) mm, is like that is no face's."""
    front = points[points[:, 2] <= np.median(points[:, 2])]
    x, y, z = (front - front.mean(axis=0)).T
    _, rms = _fit(np.stack([np.ones_like(x), x, y], axis=1), z)
    if rms < _FLAT_RMS_MM:
        return "flat"
    # Curvatures across the line of sight of what is tilted are a little off: good enough to name.
    fit, rms = _fit(np.stack([np.ones_like(x), x, y, x * x / 2, x * y, y * y / 2], axis=1), z)
    if rms > _SMOOTH_RMS_MM:
        return "uneven, with no eyes, nose and mouth where a face has them"
    mean, half = (fit[3] + fit[5]) / 2, math.hypot((fit[3] - fit[5]) / 2, fit[4])
    least, most = sorted((mean - half, mean + half), key=abs)
    return "round like a tin" if abs(least) < _STRAIGHT * abs(most) else "round like a ball"


def _fit(terms: Doubles, z: Doubles) -> tuple[Doubles, float]:
    """Fit by least squares; and say what that leaves, root mean square, mm."""
    fit = np.asarray(np.linalg.lstsq(terms, z, rcond=None)[0], np.float64)
    return fit, float(np.sqrt(np.mean((z - terms @ fit) ** 2)))
