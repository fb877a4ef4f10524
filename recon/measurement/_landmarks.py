"""Where the ends of the measurements are, by the surface's shape alone.

The names are those of Farkas, 1994, *Anthropometry of the Head and Face*; what a caliper finds by
touch is told here by curvature:

- sellion: the root of the nose, farthest behind the line from forehead to tip;
- pronasale: the tip of the nose, foremost;
- subnasale: the corner under the nose, farthest behind the line from tip to upper lip;
- gnathion: the chin's most forward *and* lower point: there the profile leaves the vertical by
  34 degrees, halfway from its foremost to its lowest point (which a camera ahead does not see);
- alar curvature: the groove between wing of the nose and cheek, farthest behind the line from
  ridge to cheek;
- sides of the face: the section `_DEEP_MM` behind the sellion, about where the cheekbones are
  widest. (The zygion itself is found on bone.)
"""

from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.measurement._face_map import STEP_MM, FaceMap

__all__ = ["Landmarks", "find_landmarks"]

_PROFILE_HALF, _PROFILE_MM = 2, 1.5
"""The profile is the mean of so many columns to either side, smoothed by a Gaussian, mm."""
_FOREHEAD_MM, _LIP_MM = -65.0, 30.0
"""Where the lines from the tip end: y, mm."""
_SUBNASALE_MM = (7.0, 20.0)
"""Where the subnasale is looked for: y, mm."""
_UPPER_LIP_MM = (4.0, 20.0)
"""The foremost point of the upper lip is so far under the subnasale, mm."""
_CHIN_FROM = 0.9
"""The chin is farther under the subnasale than this, lengths of the nose."""
_CHIN_SLOPE = 1.5
"""At the gnathion the profile falls so much for each mm that it goes back."""
_CHIN_DEPTH_MM = 32.0
"""What is farther behind the subnasale is the neck, mm."""
_DEEP_MM = 50.0
"""The face's width is measured so far behind the sellion, mm."""
_USUAL = 80.0
"""Percentile, over the rows, of the half widths: a frayed row does not count."""
_GROOVE_MM = (9.0, 28.0)
"""Where the grooves beside the nose are looked for: distance from the plane of symmetry, mm."""
_CHEEK_MM = 34.0
"""Where the line from the ridge to the cheek ends, mm."""
_GROOVE_ROWS_MM = (-2.0, 1.0)
"""From which row, y, to which under the subnasale, mm."""
_GROOVE_PERCENT = 70.0
"""Percentile, over those rows, of the distance of the grooves."""


class Landmarks(NamedTuple):
    """Points of the profile, (y, z) mm, and widths, mm, in the head's own frame.

    None where one is not found: the gnathion where the surface ends before it.
    """

    sellion: tuple[float, float]
    subnasale: tuple[float, float]
    gnathion: tuple[float, float] | None
    face_width: float | None
    grooves: float | None


def find_landmarks(face: FaceMap) -> Landmarks | None:
    """Find them; None where the profile does not reach from forehead to lips."""
    y = face.at
    z = _profile(face)
    known = np.flatnonzero(np.isfinite(z))
    if not len(known) or y[known[0]] > -_LIP_MM or y[known[-1]] < _LIP_MM + _UPPER_LIP_MM[1]:
        return None
    z[known[0]:known[-1]] = np.interp(y[known[0]:known[-1]], y[known], z[known])
    y, z = y[known[0]:known[-1] + 1], z[known[0]:known[-1] + 1]

    def point(at: float) -> tuple[float, float]:
        return at, float(np.interp(at, y, z))

    sellion = point(_corner(y, z, max(_FOREHEAD_MM, y[0]), 0.0, 6))
    rough = float(np.clip(_corner(y, z, 0.0, _LIP_MM, 3), *_SUBNASALE_MM))
    lips = (y >= rough + _UPPER_LIP_MM[0]) & (y <= rough + _UPPER_LIP_MM[1])
    lip = float(y[lips][z[lips].argmin()])
    subnasale = point(_corner(y, z, 0.0, lip, 3))
    nose = float(np.hypot(*np.subtract(sellion, subnasale)))
    gnathion = _gnathion(y, z, subnasale, nose)
    return Landmarks(sellion, subnasale, None if gnathion is None else point(gnathion),
                     _face_width(face, sellion, subnasale[0]), _grooves(face, subnasale[0]))


def _profile(face: FaceMap) -> Doubles:
    middle = len(face.at) // 2
    columns = face.height[:, middle - _PROFILE_HALF:middle + _PROFILE_HALF + 1]
    known = np.isfinite(columns)
    counts = known.sum(axis=1)
    mean = np.where(known, columns, 0).sum(axis=1) / np.maximum(counts, 1)
    return _smoothed(np.where(counts > 0, mean, np.nan), _PROFILE_MM)


def _gnathion(
    y: Doubles, z: Doubles, subnasale: tuple[float, float], nose: float
) -> float | None:
    """Give y of the gnathion; None where the surface ends before it."""
    chin = np.flatnonzero((y > subnasale[0] + _CHIN_FROM * nose)
                          & (z < subnasale[1] + _CHIN_DEPTH_MM))
    if not len(chin):
        return None
    forward = y - _CHIN_SLOPE * z
    at = int(chin[forward[chin].argmax()])
    return _vertex(y, forward, at, 4) if at < len(y) - 2 else None


def _face_width(face: FaceMap, sellion: tuple[float, float], to: float) -> float | None:
    """Give the width `_DEEP_MM` behind the sellion, of both sides or twice the one that shows."""
    rows = face.height[(face.at >= sellion[0]) & (face.at <= to)]
    middle, level = len(face.at) // 2, sellion[1] + _DEEP_MM
    sides = [_half_width(rows[:, middle:], level), _half_width(rows[:, middle::-1], level)]
    known = [side for side in sides if side is not None]
    return 2 * max(known) if known else None


def _half_width(rows: Floats, level: float) -> float | None:
    """Give how far out, mm, rows from the middle outward, (rows, columns), are above a level."""
    with np.errstate(invalid="ignore"):
        above = np.isfinite(rows) & (rows < level)
    rows = rows[above.any(axis=1)]
    above = above[above.any(axis=1)]
    if not len(rows):
        return None
    last = above.shape[1] - 1 - above[:, ::-1].argmax(axis=1)
    each = np.arange(len(rows))
    here, after = rows[each, last], rows[each, np.minimum(last + 1, rows.shape[1] - 1)]
    # Not known after the rim; a height that is level there has no more to say, either.
    rise = np.where(np.isfinite(after) & (after > here), after - here, np.inf)
    return STEP_MM * float(np.percentile(last + np.minimum((level - here) / rise, 1), _USUAL))


def _grooves(face: FaceMap, subnasale: float) -> float | None:
    """Give the distance of the grooves beside the nose, mm, of both sides' mean."""
    middle, reach = len(face.at) // 2, int(_CHEEK_MM / STEP_MM) + 4
    both = np.stack([face.height[:, middle:middle + reach],
                     face.height[:, middle:middle - reach:-1]])
    known = np.isfinite(both)
    counts = known.sum(axis=0)
    mean = np.where(counts > 0, np.where(known, both, 0).sum(axis=0) / np.maximum(counts, 1),
                    np.nan)
    low, high = _GROOVE_ROWS_MM
    x, found = STEP_MM * np.arange(float(reach)), []
    for row in np.flatnonzero((face.at >= low) & (face.at <= subnasale + high)):
        section = _smoothed(mean[row - 1:row + 2].mean(axis=0), STEP_MM)
        if np.isfinite(section).all():
            behind = _behind(x, section, 0.0, _CHEEK_MM)
            behind[(x < _GROOVE_MM[0]) | (x > _GROOVE_MM[1])] = -np.inf
            found.append(2 * _vertex(x, behind, int(behind.argmax()), 2))
    return float(np.percentile(found, _GROOVE_PERCENT)) if found else None


def _corner(y: Doubles, z: Doubles, start: float, end: float, reach: int) -> float:
    """Give where z, between two places, is farthest behind the line between them."""
    behind = _behind(y, z, start, end)
    return _vertex(y, behind, int(behind.argmax()), reach)


def _behind(y: Doubles, z: Doubles, start: float, end: float) -> Doubles:
    """Give how far z is behind the line between two places; -inf outside."""
    first, last = np.interp((start, end), y, z)
    slope = (last - first) / (end - start)
    away = (z - first - slope * (y - start)) / np.hypot(1, slope)
    return np.where((y >= start) & (y <= end), away, -np.inf)


def _vertex(y: Doubles, values: Doubles, at: int, reach: int) -> float:
    """Give where the parabola through the values around their maximum has its own."""
    near = slice(max(at - reach, 0), at + reach + 1)
    known = np.isfinite(values[near])
    x, v = y[near][known] - y[at], values[near][known]
    if len(x) < 3:
        return float(y[at])
    bend, slope, _ = np.polyfit(x, v, 2)
    moved = -slope / 2 / bend if bend < 0 else 0.0
    return float(y[at] + np.clip(moved, x[0], x[-1]))


def _smoothed(values: Doubles, sigma_mm: float) -> Doubles:
    """Average values at `STEP_MM` under a Gaussian; NaN stays, and counts for nothing."""
    half = int(3 * sigma_mm / STEP_MM) + 1
    kernel = np.exp(-0.5 * (np.arange(-half, half + 1) * STEP_MM / sigma_mm) ** 2)
    known = np.isfinite(values)
    sums, weights = (np.convolve(one, kernel)[half:half + len(values)]
                     for one in (np.where(known, values, 0), known.astype(float)))
    return np.where(known, sums / np.maximum(weights, 1e-9), np.nan)
