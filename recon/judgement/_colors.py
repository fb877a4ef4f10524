"""Whether colour lies where the relief has eyes, brows, nose and mouth."""

from functools import cache

import numpy as np

from denseface.recon.arrays import Bytes, Doubles, Floats
from denseface.recon.judgement._placing import mean_face, mean_face_data

__all__ = ["LEAST_COLOR_LIKENESS", "color_likeness"]

LEAST_COLOR_LIKENESS = 0.08
"""Less is doubted. Right colours have 0.19 and more on scans of heads, 0.11 on the procedural one;
those of another place about 0: docs/decisions/0054-a-face-by-its-relief.md."""

_CELL_MM = 5.0
_HALF_WIDTH_MM, _HIGHEST_MM, _LOWEST_MM = 70.0, -75.0, 65.0
"""The part of the mean face that is compared: hair and neck lie beyond."""
_MOST = 3000
"""Points are enough: some in each cell."""
_DARK = 8.0
"""Grey levels that are added before the logarithm: noise in the dark tells nothing."""
_FEWEST = 60
"""Cells, with fewer of which nothing is said."""
_RADIUS_MM = 85.0
"""Turns angles into mm, as for the relief."""


def color_likeness(placement: Doubles, points: Floats, colors: Bytes) -> float | None:
    """Correlate the brightness of a face with the mean face's, where that was laid on it.

    What a quadric leaves of either's logarithm is compared: so neither skin nor the lamp's side
    tell much, but that eyes, brows, nostrils and mouth are darker than what is around them.

    Parameters
    ----------
    placement : (13,), of the mean face on the points
    points : (n, 3) float32, mm, depth camera frame
    colors : (n, 3) uint8, RGB

    Returns
    -------
    from -1 to 1; None where too little of a face is there
    """
    some = np.s_[::-(-len(points) // _MOST) or 1]
    x, y, z = ((points[some] - placement[9:12]) @ placement[:9].reshape(3, 3) / placement[12]).T
    around = np.arctan2(x, mean_face().axis_z - z) * _RADIUS_MM
    columns, rows = (np.rint((along - low) / _CELL_MM).astype(np.intp)
                     for along, low in ((around, -_HALF_WIDTH_MM), (y, _HIGHEST_MM)))
    expected = _mean_brightness()
    height, width = expected.shape
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    cells = rows[inside] * width + columns[inside]
    brightness = np.log(colors[some][inside].mean(axis=1) + _DARK)
    counts = np.bincount(cells, minlength=height * width)
    sums = np.bincount(cells, brightness, minlength=height * width)
    seen = np.flatnonzero(counts)
    if len(seen) < _FEWEST:
        return None
    v, u = np.divmod(seen, width) * np.array(_CELL_MM / _RADIUS_MM)
    terms = np.stack([np.ones_like(u), u, v, u * u, u * v, v * v], axis=1)
    both = np.stack([sums[seen] / counts[seen], expected.ravel()[seen]], axis=1)
    own, mean = (both - terms @ np.linalg.lstsq(terms, both, rcond=None)[0]).T
    return float(own @ mean / max(np.sqrt((own @ own) * (mean @ mean)), 1e-9))


@cache
def _mean_brightness() -> Doubles:
    """Give the logarithm of the mean face's brightness in its cells, (heights, widths)."""
    data = mean_face_data()
    brightness, (angle, step, height, down, _) = data["brightness"], data["axes"]
    around = np.arange(-_HALF_WIDTH_MM, _HALF_WIDTH_MM + 1, _CELL_MM) / _RADIUS_MM
    columns = np.rint((np.degrees(around) - angle) / step).astype(np.intp)
    rows = np.arange(_HIGHEST_MM, _LOWEST_MM + 1, _CELL_MM)
    rows = np.rint((rows - height) / down).astype(np.intp)
    return np.asarray(brightness[np.ix_(rows, columns)], np.float64)
