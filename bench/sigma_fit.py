"""The coefficients of `recon.propagation.uncertainty`, by maximum likelihood.

Errors have heavier tails than a normal distribution, so the likelihood is Student's t with five
degrees of freedom, whose scale a few large errors do not set; then all is scaled so that 68 %
within one sigma and 95 % within two are missed by the same amount, upward and downward.
"""

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize

from bench.calibration_samples import Samples
from denseface.recon import Preset

__all__ = ["fitted"]

_FREEDOM = 5.0
"""Degrees of freedom of Student's t."""
_RIM_WEIGHT = 3.0
"""Weight of points at the rim: they are few, and their sigma shall be right too."""
_WITHIN = (0.6827, 0.9545)
"""Fractions of a normal distribution within one and two sigma."""
_FITS_ALONE = (Preset.FAITHFUL, Preset.PAPER)

Floats = NDArray[np.float64]


def fitted(samples: dict[Preset, Samples]) -> dict[str, tuple[float, ...]]:
    """Fit the coefficients of fits with detail (`best`) and without (the other presets)."""
    alone = Samples.joined([samples[preset] for preset in _FITS_ALONE])
    return {"_DETAILED": tuple(_most_likely(samples[Preset.BEST]).tolist()),
            "_FIT_ALONE": tuple(_most_likely(alone).tolist())}


def _most_likely(of: Samples) -> Floats:
    """Give the nonnegative coefficients of the components, (k,)."""
    size = np.maximum(of.components.mean(axis=0), 1e-9)
    parts, squares = of.components / size, of.error**2
    weights = np.where(of.rim, _RIM_WEIGHT, 1.0)
    weights /= weights.sum()

    def cost(logs: Floats) -> tuple[float, Floats]:
        factors = np.exp(logs)
        variance = parts @ factors + 1e-9
        odds = squares / variance
        value = weights @ (np.log(variance) + (_FREEDOM + 1) * np.log1p(odds / _FREEDOM)) / 2
        slope = weights / variance * (1 - (_FREEDOM + 1) * odds / (_FREEDOM + odds)) / 2
        return float(value), (slope @ parts) * factors

    start = np.full(parts.shape[1], -math.log(parts.shape[1]))
    found = np.exp(minimize(cost, start, jac=True, method="L-BFGS-B",
                            bounds=[(-14, 6)] * len(start)).x) / size
    return np.asarray(found * _balanced(of.components @ found, of) ** 2)


def _balanced(variance: Floats, of: Samples) -> float:
    sigma = np.sqrt(variance)
    return float(brentq(lambda scale: _imbalance(scale * sigma, of), 0.2, 5))


def _imbalance(sigma: Floats, of: Samples) -> float:
    share = np.abs(of.error / sigma)[of.everywhere]
    return sum(float((share < k).mean()) - nominal for k, nominal in enumerate(_WITHIN, 1))
