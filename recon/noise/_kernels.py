"""Mean squared differences of a depth lattice, and the noise that explains them, compiled."""

import numpy as np

from denseface.recon.arrays import Bytes, Doubles, Floats, Ints
from denseface.recon.numerics.jit import compiled

LAGS = np.array([1, 2, 3, 4, 6, 8])
"""Pixels."""
_NORMS = np.array([6.0, 20.0])
"""Sum of the squared coefficients of a second (1, -2, 1) and a third (-1, 3, -3, 1) difference: so
many times its variance white noise adds."""
_KEPT = 0.7
"""Part of the squares, the least ones, whose mean counts: lips, lids and edges are not noise."""
_KEPT_MEAN = 0.3096
"""Mean of that part for normal numbers of unit variance."""
_BINS, _BIN_MM = 2048, 0.01
"""Of the histogram of absolute differences, over the root of their norm."""

FACE = np.array([[4.87e-4, 3.59], [4.94e-5, 4.02]])
"""(a, b) of second and third differences: a face's own part over a lag of x mm is a x^b, mm^2.
Fitted to the heads that settings are chosen on."""
_HIDDEN = np.array([0.30, 0.48])
"""Beside noise of r times its own part a face adds (1 + r)^c times it to the mean of the least
squares, c of second and third differences: what is left out without noise is then among them."""
_OWN_ERROR, _FACE_ERROR = 0.1, 0.6
"""Relative standard deviation of a mean square, and of the face's part of it."""
_LENGTHS = 0.7 * 2 ** (np.arange(11) / 4)
"""Lengths that are tried, pixels: 0.7 to 4."""
_USUAL_LENGTH, _LENGTH_WEIGHT = 2.0, 10.0
"""The length that is assumed where the frame does not tell (pixels), and the cost of its squared
logarithm."""


@compiled
def lattice(points: Floats, pixels: Ints) -> Floats:
    """Give z by row and column, mm, 0 where no seed is: (rows, columns)."""
    top, left = pixels[:, 0].min(), pixels[:, 1].min()
    heights = np.zeros(
        (pixels[:, 0].max() - top + 1, pixels[:, 1].max() - left + 1), np.float32)
    for i in range(len(pixels)):
        heights[pixels[i, 0] - top, pixels[i, 1] - left] = points[i, 2]
    return heights


@compiled
def mean_square_differences(heights: Floats, gentle: Bytes, every: int) -> Doubles:
    """Give the trimmed mean squares of second and third differences, over `_NORMS`, (2, lags).

    Those of normal noise are its variance, mm^2. 0 where there are too few.

    heights : (rows, columns), 0 where none is; gentle : 1 where differences count
    every : of the rows (for differences along them) and columns, so many
    """
    out = np.zeros((2, len(LAGS)))
    turned, counted = np.ascontiguousarray(heights.T), np.ascontiguousarray(gentle.T)
    for i in range(len(LAGS)):
        counts, sums = np.zeros((2, _BINS), np.int32), np.zeros((2, _BINS))
        _collect(heights, gentle, every, LAGS[i], counts, sums)
        _collect(turned, counted, every, LAGS[i], counts, sums)
        for k in range(2):
            out[k, i] = _trimmed(counts[k], sums[k])
    return out


@compiled
def _collect(
    heights: Floats, gentle: Bytes, every: int, lag: int, counts: Ints, sums: Doubles
) -> None:
    """Add the differences along rows to the histograms."""
    scales = np.float32(1) / np.sqrt(_NORMS).astype(np.float32)
    per_bin = np.float32(1 / _BIN_MM)
    columns = np.uint64(heights.shape[1])
    second, known = np.empty(columns, np.float32), np.empty(columns, np.bool_)
    one, two, three = np.uint64(lag), np.uint64(2 * lag), np.uint64(3 * lag)
    for row in range(0, heights.shape[0], every):
        line, counted = heights[row], gentle[row]
        ends = max(heights.shape[1] - 2 * lag, 0)
        # The differences of a whole row at once, then which of them count.
        for j in range(np.uint64(ends)):
            a, b, c = line[j], line[j + one], line[j + two]
            second[j] = a - b - (b - c)
            known[j] = ((a != 0) & (b != 0) & (c != 0)) & (counted[j + one] != 0)
        for j in range(np.uint64(ends)):
            if not known[j]:
                continue
            value = abs(second[j]) * scales[0]
            index = np.uint32(min(value * per_bin, np.float32(_BINS - 1)))
            counts[0, index] += 1
            sums[0, index] += value * value
            if j + three < columns and line[j + three] > 0 and counted[j + two]:
                b, c = line[j + one], line[j + two]
                value = abs(b - c - (c - line[j + three]) - second[j]) * scales[1]
                index = np.uint32(min(value * per_bin, np.float32(_BINS - 1)))
                counts[1, index] += 1
                sums[1, index] += value * value


@compiled
def _trimmed(counts: Ints, sums: Doubles) -> float:
    """Give the mean of the least squares, as a variance; 0 where there are too few."""
    wanted = _KEPT * counts.sum()
    if wanted < 70:
        return 0.0
    seen, total = 0.0, 0.0
    for k in range(len(counts)):
        part = min(1.0, (wanted - seen) / max(counts[k], 1))
        total += part * sums[k]
        seen += part * counts[k]
        if part < 1:
            break
    return float(total / wanted / _KEPT_MEAN)


@compiled
def explain(squares: Doubles, spacing: float) -> tuple[float, float, float]:
    """Explain mean squares by a face, white noise and noise alike over some pixels.

    Weighted least squares with variances at least 0, for each length; the best length wins.

    squares : (2, lags), mm^2, of `mean_square_differences`; spacing : of neighbouring pixels, mm

    Gives the variances, mm^2, white and alike, and the length, pixels.
    """
    noise, weight = np.zeros(squares.shape), np.zeros(squares.shape)
    for k in range(2):
        for i in range(len(LAGS)):
            face = FACE[k, 0] * (LAGS[i] * spacing) ** FACE[k, 1]
            if squares[k, i] > 0:
                noise[k, i] = _without_face(squares[k, i], face, _HIDDEN[k])
                error = _OWN_ERROR * squares[k, i] + _FACE_ERROR * max(
                    squares[k, i] - noise[k, i], face)
                weight[k, i] = 1 / (error + 1e-4) ** 2
    least, white, smooth, length = np.inf, 0.0, 0.0, _USUAL_LENGTH
    for candidate in _LENGTHS:
        cost, one, other = _nonnegative_fit(noise, weight, candidate)
        cost += _LENGTH_WEIGHT * np.log(candidate / _USUAL_LENGTH) ** 2
        if cost < least:
            least, white, smooth, length = cost, one, other, candidate
    return white, smooth, length


@compiled
def _without_face(square: float, face: float, hidden: float) -> float:
    """Solve noise + face (1 + noise / face)^hidden = square; below 0 where the face is less."""
    if square <= face:
        return square - face
    low, high = 0.0, square
    for _ in range(20):
        middle = 0.5 * (low + high)
        if middle + face * (1 + middle / face) ** hidden > square:
            high = middle
        else:
            low = middle
    return 0.5 * (low + high)


@compiled
def _nonnegative_fit(
    noise: Doubles, weight: Doubles, length: float
) -> tuple[float, float, float]:
    """Give the cost and both variances for one length."""
    a = b = c = p = q = r = 0.0
    for k in range(2):
        for i in range(len(LAGS)):
            alike = np.exp(-(np.arange(1, 4) * LAGS[i] / (2 * length)) ** 2)
            part = (1 - (8 * alike[0] - 2 * alike[1]) / 6 if k == 0
                    else 1 - (30 * alike[0] - 12 * alike[1] + 2 * alike[2]) / 20)
            w, y = weight[k, i], noise[k, i]
            a += w
            b += w * part
            c += w * part * part
            p += w * y
            q += w * part * y
            r += w * y * y
    determinant = a * c - b * b
    one = (c * p - b * q) / max(determinant, 1e-30)
    other = (a * q - b * p) / max(determinant, 1e-30)
    if other < 0 or determinant <= 0:
        one, other = max(p / max(a, 1e-30), 0.0), 0.0
    elif one < 0:
        one, other = 0.0, max(q / max(c, 1e-30), 0.0)
    return (r - 2 * (one * p + other * q) + one * one * a + 2 * one * other * b
            + other * other * c), one, other
