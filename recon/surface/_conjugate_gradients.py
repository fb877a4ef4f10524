"""The solution of the RBF fit, compiled.

Grids are flat: row after row, each followed by `pad` unused places, so that a step to any
neighbour within `pad` is one number, and one long loop serves the whole grid.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["conjugate_gradients"]


@compiled
def _apply(
    density: NDArray[np.float32], decay: NDArray[np.float32], smoothing: float,
    G: NDArray[np.float32], used: NDArray[np.float32], width: int, first: int, size: int,
    alpha: NDArray[np.float32], out: NDArray[np.float32],
) -> None:
    """Compute out = (H + lambda I - G^T G) alpha, with H[t, t'] = decay[t - t'] D((t + t')/2)."""
    # Slices, since an index that might be negative keeps a loop from being vectorised.
    reach = (len(decay) - 1) // 2
    here, own = out[first:first + size], alpha[first:first + size]
    itself, plane = decay[reach, reach], density[0, 0, first:first + size]
    for i in range(size):
        here[i] = (np.float32(smoothing) + itself * plane[i]) * own[i]
    # Each step together with the opposite one, whose decay is the same.
    for down in range(reach + 1):
        for right in range(-reach if down else 1, reach + 1):
            factor = decay[down + reach, right + reach]
            if factor == 0:
                continue
            step, middle = down * width + right, first + (down >> 1) * width + (right >> 1)
            back = first + (-down >> 1) * width + (-right >> 1)
            one = density[down & 1, right & 1, middle:middle + size]
            other = density[down & 1, right & 1, back:back + size]
            after = alpha[first + step:first + step + size]
            before = alpha[first - step:first - step + size]
            for i in range(size):
                here[i] += factor * (one[i] * after[i] + other[i] * before[i])
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


@compiled
def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> float:
    total = 0.0
    for start in range(0, len(a), 64):
        part = np.float32(0)
        for i in range(start, min(start + 64, len(a))):
            part += a[i] * b[i]
        total += float(part)
    return total


@compiled
def conjugate_gradients(
    density: NDArray[np.float32], decay: NDArray[np.float32], smoothing: float,
    G: NDArray[np.float32], used: NDArray[np.float32], width: int, first: int, size: int,
    right: NDArray[np.float32], tolerance: float, most: int,
) -> tuple[NDArray[np.float32], int]:
    """Solve (H + lambda I - G^T G) alpha = right, preconditioned by the diagonal.

    density : (2, 2, n), D on the half-step grid: plane [a, b] holds, flat, the points
        (2 row + a, 2 column + b)
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
