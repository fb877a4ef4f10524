"""Systems of a few equations, solved, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["solve_small"]

# Makes a system that leaves something open no division by zero, and changes nothing else.
_RIDGE = 1e-6


@compiled
def solve_small(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve a positive definite system by elimination; both are written over."""
    size = len(right)
    for k in range(size):
        matrix[k, k] += _RIDGE
    for k in range(size):
        for row in range(k + 1, size):
            share = matrix[row, k] / matrix[k, k]
            right[row] -= share * right[k]
            for column in range(k, size):
                matrix[row, column] -= share * matrix[k, column]
    for k in range(size - 1, -1, -1):
        for column in range(k + 1, size):
            right[k] -= matrix[k, column] * right[column]
        right[k] /= matrix[k, k]
    return right
