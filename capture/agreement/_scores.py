"""How much better the colour's edges fit depth's outlines where they are than beside them."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.capture.agreement._edges import Edges
from denseface.capture.agreement._outlines import Outlines

__all__ = ["Fit", "best_shift", "measure_fit"]

_SHIFTS = np.array([(0, 0), *(
    (dx, dy) for dx in range(-48, 49, 8) for dy in range(-24, 25, 12) if dx * dx + dy * dy >= 64)])
"""Pixels (u, v): where it is, then beside it."""
_FINE = np.arange(-40, 41, 2)
"""Pixels, among which the best shift is sought."""
_BESIDE_PX = 4
"""Pixels up to which outlines and edges may lie beside each other."""
_CLEAR_PEAK, _ABOVE_HERE = 4.0, 3.0
"""Score of a shift that is clearly the best, and by how much it is better than no shift, standard
deviations."""
_FEWEST = 60
"""Samples inside the colour image, with fewer of which nothing is measured."""


class Fit(NamedTuple):
    """How well outlines and edges fit."""

    score: float
    """Mean strength of the edges on the outlines, less the same on shifted outlines, by the
    standard deviation among those: how improbable a fit by chance is. 0 where nothing is known."""
    samples: int
    """Of the outlines inside the colour image."""


def measure_fit(edges: Edges, outlines: Outlines, uv: NDArray[np.floating]) -> Fit:
    """Measure the edges on outlines that would be seen at `uv`, (n, 2) pixels."""
    at, inside = edges.indices(uv)
    if len(at) < _FEWEST:
        return Fit(0.0, len(at))
    means = strengths(edges, at, outlines.upright[inside], _SHIFTS)
    around = means[1:]
    return Fit(float((means[0] - around.mean()) / max(around.std(), 1e-6)), len(at))


def strengths(
    edges: Edges, at: NDArray[np.int64], upright: NDArray[np.bool_], shifts: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Give the mean strength of the edges on shifted outlines, (k,) for k shifts (u, v)."""
    steps = shifts[:, 1] * edges.upright.shape[1] + shifts[:, 0]
    values = np.concatenate([
        image.ravel()[at[chosen, None] + steps]
        for image, chosen in ((edges.upright, upright), (edges.level, ~upright))])
    return np.asarray(np.nanmean(values, axis=0, dtype=np.float64))


def best_shift(edges: Edges, outlines: Outlines, uv: NDArray[np.floating]) -> tuple[int, int]:
    """Find how far the edges clearly lie beside outlines seen at `uv`, (n, 2) pixels.

    Upright outlines tell how far aside, level ones how far up or down.

    Returns
    -------
    (u, v), pixels of the colour image; 0 where they lie on them, or it is not clear
    """
    at, inside = edges.indices(uv)
    upright = outlines.upright[inside]
    found = []
    for chosen, way in ((upright, (1, 0)), (~upright, (0, 1))):
        found.append(0)
        if np.count_nonzero(chosen) < _FEWEST:
            continue
        means = strengths(edges, at[chosen], upright[chosen], _FINE[:, None] * way)
        low, middle, high = np.percentile(means, (16, 50, 84))
        scores = 2 * (means - middle) / max(high - low, 1e-6)
        best = int(np.argmax(scores))
        here = scores[np.abs(_FINE) <= _BESIDE_PX].max()
        if scores[best] >= max(_CLEAR_PEAK, here + _ABOVE_HERE):
            found[-1] = round(_FINE[best] / edges.scale)
    return found[0], found[1]
