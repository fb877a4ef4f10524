"""The linear system of the RBF fit, solved by preconditioned conjugate gradients, compiled.

Grids are flat: row after row, each followed by unused entries, so that a step to any neighbour
within reach is one number, and one long loop serves the whole grid.
"""

from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.numerics.jit import compiled


class NodeSystem(NamedTuple):
    """The matrix H + lambda I - G^T G over the nodes, with H[t, t'] = decay[t - t'] D((t + t')/2).

    n counts the entries of the padded grid.
    """

    density: Floats
    """(2, 2, n), D on the half-step grid: [a, b] holds the points (2 row + a, 2 column + b)."""
    decay: Floats
    """(2 reach + 1, 2 reach + 1), by steps down and right."""
    smoothing: float
    """lambda."""
    G: Floats
    """(6, n)."""
    used: Floats
    """(n,), 1 on the grid, 0 on unused entries."""
    width: int
    """Entries from row to row."""


@compiled
def _apply(system: NodeSystem, alpha: Floats, out: Floats) -> None:
    """Compute out = (H + lambda I - G^T G) alpha."""
    density, decay, smoothing, G, used, width = system
    reach = (len(decay) - 1) // 2
    # From the grid's first entry to its last. Slices, since an index that might be negative keeps
    # a loop from being vectorised.
    first = reach * width + reach
    size = len(used) - 2 * first
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
def _dot(a: Floats, b: Floats) -> float:
    """Sum in single precision over 64 products each, beyond that in double."""
    total = 0.0
    for start in range(0, len(a), 64):
        part = np.float32(0)
        for i in range(start, min(start + 64, len(a))):
            part += a[i] * b[i]
        total += float(part)
    return total


@compiled
def conjugate_gradients(
    system: NodeSystem, right: Floats, tolerance: float, max_iterations: int
) -> Floats:
    """Solve a system for its right side, preconditioned by the diagonal.

    right : (n,), 0 on unused entries; tolerance : of the preconditioned residual's norm, relative

    Returns alpha, (n,).
    """
    middle = system.decay[(len(system.decay) - 1) // 2, (len(system.decay) - 1) // 2]
    inverse = system.used.copy()
    for i in range(len(inverse)):
        inverse[i] /= middle * system.density[0, 0, i] + np.float32(system.smoothing)
    alpha, product = np.zeros_like(right), np.zeros_like(right)
    r = right.copy()
    d = r * inverse
    start = before = _dot(r, d)
    for _ in range(max_iterations):
        if before <= tolerance * tolerance * start:
            break
        _apply(system, d, product)
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
    return alpha
