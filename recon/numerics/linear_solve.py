"""Systems of a few linear equations, compiled."""


from denseface.recon.arrays import Doubles
from denseface.recon.numerics.jit import compiled

__all__ = ["solve_small"]

_RIDGE = 1e-6
"""Added to the diagonal: keeps singular systems solvable."""


@compiled
def solve_small(matrix: Doubles, right: Doubles) -> Doubles:
    """Solve a positive definite system by elimination, (n, n) and (n,); both are overwritten."""
    size = len(right)
    for k in range(size):
        matrix[k, k] += _RIDGE
    for k in range(size):
        for row in range(k + 1, size):
            factor = matrix[row, k] / matrix[k, k]
            right[row] -= factor * right[k]
            for column in range(k, size):
                matrix[row, column] -= factor * matrix[k, column]
    for k in range(size - 1, -1, -1):
        for column in range(k + 1, size):
            right[k] -= matrix[k, column] * right[column]
        right[k] /= matrix[k, k]
    return right
