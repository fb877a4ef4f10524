r"""The expected error of a fit, before it is made; the fit whose error is least.

Of a face that is a Gaussian process over (X, Y) with spectral density S(k) = A k^-p, seen with
noise of density N(k), a linear smoother that passes T(k) of a wave leaves an error of

    E = int ((1 - T)^2 S + T^2 N) k dk / 2 pi     [mm^2]

(Wahba, 1990, doi:10.1137/1.9781611970128, ch. 4; Wiener's filter T = S / (S + N) where T is free).
The fit passes G = F / (F + lambda h^2), F = pi R0^2 exp(-k^2 R0^2 / 4); local averages of what it
leaves, kept in part w, add w (1 - G) exp(-k^2 r^2 / 2).
"""

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.noise._measure import Noise
from denseface.recon.numerics.jit import compiled

_FACE_DENSITY, _FACE_FALL = 0.035, 4.5
"""A and p, k in 1/mm, S in mm^4: of faces less their quadratic trend. Chosen so that the least
risk is the least error of the heads that settings are chosen on (docs/method.md)."""
_LONGEST_MM = 150.0
"""Longest wave that counts; what is longer any fit follows."""
_WAVES = 48
"""Number of wave lengths of the integrals."""
_CUTOFFS = np.geomspace(8.0, 36.0, 17)
"""Waves longer than this pass a fit, mean spacings: those that are tried."""
SHARPNESS = (0.66, 0.8)
"""R0 over the cut-off: broader Gaussians cut more sharply. Those that are tried."""


class Risk(NamedTuple):
    """What a fit is expected to do.

    Attributes
    ----------
    r0_factor, smoothing : R0 in mean spacings, lambda
    error_mm : root mean square of the expected error
    radius_mm : of the Gaussian whose self-convolution is that error's covariance
    bias_share, white_share, smooth_share : expected squares of what the fit takes off the face, and
        of the white and the smooth noise that it lets pass, each over that of the seeds about the
        surface
    detail_noise : variance of the noise in what local averages add, mm^2
    fit_noise : variance of the noise in the fit, mm^2
    least_mm : the error that the levels of depth alone leave, `Noise.level_error_mm`
    """

    r0_factor: float
    smoothing: float
    error_mm: float
    radius_mm: float
    bias_share: float
    white_share: float
    smooth_share: float
    detail_noise: float
    fit_noise: float
    least_mm: float


def fit_of_cutoff(cutoff: float, sharpness: float) -> tuple[float, float]:
    """Give R0, mean spacings, and lambda of the fit of which half of a wave is left.

    cutoff : that wave's length, mean spacings; sharpness : R0 over it
    """
    r0 = sharpness * cutoff
    return r0, math.pi * r0 ** 2 * math.exp(-(math.pi * sharpness) ** 2)


def least_risk(
    noise: Noise, spacing: float, detail_factor: float | None, r0_factor: float | None = None,
    smoothing: float | None = None,
) -> Risk:
    """Give the fit of least expected error.

    Parameters
    ----------
    noise : as measured
    spacing : mean spacing of the seeds, mm
    detail_factor : radius of the averages that are added, mean spacings; None where none are
    r0_factor, smoothing : R0 in mean spacings and lambda where they are given
    """
    radius = -1.0 if detail_factor is None else detail_factor * spacing
    values = _least(_candidates(r0_factor, smoothing), noise.white_mm**2, noise.smooth_mm**2,
                    noise.length_px, spacing, radius)
    return Risk._make([*values.tolist(), noise.level_error_mm])


@lru_cache(maxsize=16)
def _candidates(r0_factor: float | None, smoothing: float | None) -> Doubles:
    """R0 in mean spacings and lambda of the fits that are tried, (n, 2)."""
    pairs = (fit_of_cutoff(cutoff, sharp) for sharp in SHARPNESS for cutoff in _CUTOFFS.tolist())
    return np.array(sorted({(r0_factor or r0, smoothing or weight) for r0, weight in pairs}))


@compiled
def _least(
    candidates: Doubles, white: float, smooth: float, length: float, h: float, radius: float
) -> Doubles:
    """Give the fields of the `Risk` of the candidate whose error is least."""
    first, last = 2 * np.pi / _LONGEST_MM, 0.9 * np.pi / h
    ratio = (last / first) ** (1 / (_WAVES - 1))
    waves = first * ratio ** np.arange(_WAVES)
    measure = waves * waves * np.log(ratio) / (2 * np.pi)
    face = _FACE_DENSITY * waves ** -_FACE_FALL * measure
    spread = (length * h) ** 2
    # Beside much that is white, what seems smooth is mostly face: it counts by its part of all.
    smooth *= smooth / max(white + smooth, 1e-12)
    white_noise = white * h * h * measure
    smooth_noise = smooth * 4 * np.pi * spread * np.exp(-waves**2 * spread) * measure
    noise = white_noise + smooth_noise
    # What is white has waves too short for the integrals, and for any fit.
    shorter = white * max(0.0, 1 - h * h * last * last / (4 * np.pi))
    average = np.exp(-0.5 * (waves * radius) ** 2) if radius > 0 else np.zeros(_WAVES)
    best = np.zeros(9)
    for i in range(len(candidates)):
        r0 = candidates[i, 0] * h
        gaussian = np.pi * r0 * r0 * np.exp(-0.25 * (waves * r0) ** 2)
        fit = gaussian / (gaussian + candidates[i, 1] * h * h)
        added = (1 - fit) * average
        signal, din = (added * (1 - fit) * face).sum(), (added * added * noise).sum()
        energy = (added * added * face).sum() + din
        kept = (signal - (added * fit * noise).sum()) / energy if energy > 0 else 0.0
        passed = fit + min(max(kept, 0.0), 1.0) * added
        error = (1 - passed) ** 2 * face + passed * passed * noise
        total = error.sum()
        if i == 0 or total < best[2]:
            left = ((1 - passed) ** 2 * (face + noise)).sum() + shorter
            best[0], best[1], best[2] = candidates[i, 0], candidates[i, 1], total
            best[3] = np.sqrt(total / (error * waves * waves).sum())
            best[4] = ((1 - passed) ** 2 * face).sum() / left
            best[5] = (passed * passed * white_noise).sum() / left
            best[6] = (passed * passed * smooth_noise).sum() / left
            best[7], best[8] = din, (fit * fit * noise).sum()
    best[2] = np.sqrt(best[2])
    return best
