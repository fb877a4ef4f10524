"""Averages over a surface's places, and what they make of noise that is alike nearby."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.spatial import cKDTree

__all__ = ["Blur", "NullFields", "null_fields"]

_Doubles: TypeAlias = NDArray[np.float64]
_Reals: TypeAlias = NDArray[np.floating]

_REACH = 3.0
"""A Gaussian ends there, standard deviations."""
_FIELDS = 200
"""Fields of noise that are drawn."""


class Blur:
    """Gaussian averages between places, (n, 3) mm.

    Attributes
    ----------
    scale_mm : standard deviation
    """

    def __init__(self, points: _Doubles, scale_mm: float) -> None:
        tree = cKDTree(points)
        near = tree.sparse_distance_matrix(tree, _REACH * scale_mm, output_type="coo_matrix")
        weights = np.exp(-0.5 * (near.data / scale_mm) ** 2)
        apart = near.row != near.col
        count = len(points)
        self.scale_mm = scale_mm
        self._matrix = sparse.csr_array(
            (np.concatenate([weights[apart], np.ones(count)]).astype(np.float32),
             (np.concatenate([near.row[apart], np.arange(count)]),
              np.concatenate([near.col[apart], np.arange(count)]))), shape=(count, count))

    def sums(self, values: _Reals) -> _Doubles:
        """Add up values, (n,) or (n, k), under the Gaussian."""
        return np.asarray(self._matrix @ values, np.float64)

    def mean(self, values: _Reals, known: NDArray[np.bool_]) -> _Doubles:
        """Average the values, (n,) or (n, k), of known places; 0 where none is near."""
        weight = np.maximum(self.sums(known.astype(np.float32)), 1e-9)
        masked = np.where(known if values.ndim == 1 else known[:, None], values,
                          values.dtype.type(0))
        return self.sums(masked) / (weight if values.ndim == 1 else weight[:, None])

    def noise(self, white: _Reals) -> NDArray[np.float32]:
        """Make of white noise, (n, k), noise of variance 1 that is alike over the scale."""
        norm = np.sqrt(np.asarray(self._matrix.multiply(self._matrix).sum(axis=1)))
        return np.asarray(self.sums(white) / norm[:, None], np.float32)


@dataclass(frozen=True, eq=False)
class NullFields:
    """What averages of pure noise of variance 1 are like.

    Attributes
    ----------
    fields : (n, k) float32, the noise itself, 0 where nothing is known
    deviation : of each average, (n,) float64, standard deviation place by place
    extremes : (k,) float64, the largest average of each field over all places and averages, in
        those standard deviations
    """

    fields: NDArray[np.float32]
    deviation: list[_Doubles]
    extremes: _Doubles

    def threshold(self, confidence: float) -> float:
        """Give what the largest of pure noise stays below in such a share of cases.

        By the extreme value distribution of Gumbel through mean and standard deviation of the
        drawn ones, so that a confidence near 1 asks for no thousands of them.
        """
        beta = float(self.extremes.std()) * np.sqrt(6) / np.pi
        location = float(self.extremes.mean()) - np.euler_gamma * beta
        return float(location - beta * np.log(-np.log(confidence)))


def null_fields(
    points: _Doubles, known: NDArray[np.bool_], length_mm: float, blurs: Sequence[Blur]
) -> NullFields:
    """Draw fields of noise that is alike over a length, and average them as differences are."""
    white = np.random.default_rng(0).standard_normal(
        (len(points), _FIELDS), np.float32)
    fields = Blur(points, length_mm).noise(white)
    fields[~known] = 0
    deviation, extremes = [], np.zeros(_FIELDS)
    for blur in blurs:
        means = blur.mean(fields, known)
        deviation.append(np.maximum(np.sqrt((means**2).mean(axis=1)), 1e-3))
        extremes = np.maximum(
            extremes, np.abs(means / deviation[-1][:, None])[known].max(axis=0, initial=0))
    return NullFields(fields, deviation, extremes)
