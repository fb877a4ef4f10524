"""The loops of the RBF fit, compiled.

Compiled code is cached beside this file or, where that is read-only, in the user's cache folder;
where neither can be written, it is compiled at each start.

Grids are flat: row after row, each followed by `pad` unused places, so that a step to any
neighbour within `pad` is one number, and one long loop serves the whole grid.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

__all__ = ["CHANNELS", "conjugate_gradients", "spread", "spread_density"]

CHANNELS = 8
"""Values that `spread` sums at once: a count known when it is compiled, one vector register."""

_F = TypeVar("_F", bound=Callable[..., Any])


def _compiled(function: _F) -> _F:
    try:
        return cast("_F", njit(cache=True, fastmath=True)(function))
    except RuntimeError:  # numba found no folder for its cache
        return cast("_F", njit(fastmath=True)(function))


@_compiled
def _gaussians(gap: float, sharpness: float, out: NDArray[np.float32]) -> None:
    """out[k] = exp(-sharpness (gap - k)^2), each from the one before."""
    value = np.exp(-sharpness * gap * gap)
    ratio = np.exp(sharpness * (2 * gap - 1))
    decay = np.exp(-2 * sharpness)
    for k in range(len(out)):
        out[k] = value
        value *= ratio
        ratio *= decay


@_compiled
def spread(
    x: NDArray[np.float64], y: NDArray[np.float64], values: NDArray[np.float32],
    sharpness: float, reach: int, rows: int, columns: int,
) -> NDArray[np.float32]:
    """Sum values[i] exp(-sharpness ((x_i - column)^2 + (y_i - row)^2)) over a grid.

    x, y : (n,), in grid steps, at least `reach` from the grid's outside
    values : (n, CHANNELS)

    Gives (rows, columns, CHANNELS).
    """
    out = np.zeros((rows, columns * CHANNELS), np.float32)
    across = np.empty(2 * reach + 1, np.float32)
    down = np.empty(2 * reach + 1, np.float32)
    mine = np.empty((2 * reach + 1) * CHANNELS, np.float32)
    for i in range(len(x)):
        left, top = int(np.rint(x[i])) - reach, int(np.rint(y[i])) - reach
        _gaussians(x[i] - left, sharpness, across)
        _gaussians(y[i] - top, sharpness, down)
        for column in range(2 * reach + 1):
            for c in range(CHANNELS):
                mine[column * CHANNELS + c] = across[column] * values[i, c]
        for row in range(2 * reach + 1):
            line = out[top + row, left * CHANNELS:left * CHANNELS + len(mine)]
            factor = down[row]
            for k in range(len(mine)):
                line[k] += factor * mine[k]
    return out.reshape(rows, columns, CHANNELS)


@_compiled
def spread_density(
    x: NDArray[np.float64], y: NDArray[np.float64], W: NDArray[np.float32],
    sharpness: float, reach: int, rows: int, width: int,
) -> NDArray[np.float32]:
    """Sum weights over the half-step grid, laid out as four planes of every second point.

    x, y : (n,), in half steps, at least `reach` + 1 from the grid's outside; W : (n,)
    rows, width : of one plane

    Gives (2, 2, rows, width): plane [a, b] holds the points (2 row + a, 2 column + b).
    """
    out = np.zeros((2, 2, rows, width), np.float32)
    across = np.empty(2 * reach + 2, np.float32)
    down = np.empty(2 * reach + 1, np.float32)
    even, odd = np.empty(reach + 1, np.float32), np.empty(reach + 1, np.float32)
    for i in range(len(x)):
        left, top = int(np.rint(x[i])) - reach, int(np.rint(y[i])) - reach
        left -= left & 1
        _gaussians(x[i] - left, sharpness, across)
        _gaussians(y[i] - top, sharpness, down)
        for k in range(reach + 1):
            even[k], odd[k] = across[2 * k], across[2 * k + 1]
        first = left >> 1
        for k in range(2 * reach + 1):
            row = top + k
            weight = W[i] * down[k]
            to_even = out[row & 1, 0, row >> 1, first:first + reach + 1]
            to_odd = out[row & 1, 1, row >> 1, first:first + reach + 1]
            for column in range(reach + 1):
                to_even[column] += weight * even[column]
                to_odd[column] += weight * odd[column]
    return out


@_compiled
def _apply(
    density: NDArray[np.float32], decay: NDArray[np.float32], smoothing: float,
    G: NDArray[np.float32], used: NDArray[np.float32], width: int, first: int, size: int,
    alpha: NDArray[np.float32], out: NDArray[np.float32],
) -> None:
    """Compute out = (H + lambda I - G^T G) alpha, with H[t, t'] = decay[t - t'] D((t + t')/2)."""
    # Slices, since an index that might be negative keeps a loop from being vectorised.
    reach = (len(decay) - 1) // 2
    here, own = out[first:first + size], alpha[first:first + size]
    for i in range(size):
        here[i] = np.float32(smoothing) * own[i]
    for down in range(-reach, reach + 1):
        for right in range(-reach, reach + 1):
            factor = decay[down + reach, right + reach]
            if factor == 0:
                continue
            middle = first + (down >> 1) * width + (right >> 1)
            plane = density[down & 1, right & 1, middle:middle + size]
            other = first + down * width + right
            there = alpha[other:other + size]
            for i in range(size):
                here[i] += factor * plane[i] * there[i]
    for k in range(len(G)):
        line = G[k, first:first + size]
        total = np.float32(0)
        for i in range(size):
            total += line[i] * own[i]
        for i in range(size):
            here[i] -= total * line[i]
    mask = used[first:first + size]
    for i in range(size):
        here[i] *= mask[i]


@_compiled
def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    total = 0.0
    for start in range(0, len(a), 64):
        part = np.float32(0)
        for i in range(start, min(start + 64, len(a))):
            part += a[i] * b[i]
        total += float(part)
    return total


@_compiled
def conjugate_gradients(
    density: NDArray[np.float32], decay: NDArray[np.float32], smoothing: float,
    G: NDArray[np.float32], used: NDArray[np.float32], width: int, first: int, size: int,
    right: NDArray[np.float32], tolerance: float, most: int,
) -> tuple[NDArray[np.float32], int]:
    """Solve (H + lambda I - G^T G) alpha = right, preconditioned by the diagonal.

    density : (2, 2, n), as `spread_density` gives it, planes flat
    decay : (2 reach + 1, 2 reach + 1)
    G : (p, n); used : (n,), 1 on the grid, 0 on unused places; right : (n,), 0 on unused places
    width : places from row to row; first, size : where the grid begins, and its places

    Gives alpha, (n,), and the number of iterations.
    """
    middle = decay[(len(decay) - 1) // 2, (len(decay) - 1) // 2]
    inverse = used.copy()
    for i in range(len(inverse)):
        inverse[i] /= middle * density[0, 0, i] + np.float32(smoothing)
    alpha, product = np.zeros_like(right), np.zeros_like(right)
    r = right.copy()
    d = r * inverse
    start = before = _dot(r, d)
    taken = 0
    while taken < most and before > tolerance * tolerance * start:
        taken += 1
        _apply(density, decay, smoothing, G, used, width, first, size, d, product)
        step = np.float32(before / _dot(d, product))
        now = 0.0
        for i in range(len(d)):
            alpha[i] += step * d[i]
            r[i] -= step * product[i]
        for begin in range(0, len(d), 64):
            part = np.float32(0)
            for i in range(begin, min(begin + 64, len(d))):
                part += r[i] * r[i] * inverse[i]
            now += float(part)
        ratio = np.float32(now / before)
        for i in range(len(d)):
            d[i] = r[i] * inverse[i] + ratio * d[i]
        before = now
    return alpha, taken
