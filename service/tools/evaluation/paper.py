"""What the paper says of its own errors, and the figures that ours are told in."""

from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

__all__ = ["ERROR_BINS_MM", "GROSS_MM", "PAPER_DENSE", "PAPER_INITIAL", "PAPER_MEAN_MM",
           "PAPER_SD_MM", "PAPER_TABLE_2", "Errors", "paper_distribution", "per_mm"]

GROSS_MM = 5.5
"""The paper's Figure 9 ends here."""
ERROR_BINS_MM = np.linspace(0, GROSS_MM, 56)
"""Edges of a histogram of errors, mm."""
PAPER_MEAN_MM, PAPER_SD_MM = 1.31, 1.07
"""The paper's own error, Table 2."""
PAPER_TABLE_2 = (("Hernandez", 1.61, 1.62), ("Hwang", 3.58, 0.59), ("Lin", 3.12, 1.14),
                 ("the paper's method", PAPER_MEAN_MM, PAPER_SD_MM))
"""All four rows as the paper prints them: mean and SD, mm."""
PAPER_INITIAL, PAPER_DENSE = "8,352-13,267", "79,482-132,476"
"""The paper's Table 1."""


class Errors(NamedTuple):
    """Figures of distances from the true surface."""

    mean_mm: float
    sd_mm: float
    median_mm: float
    within_95_mm: float
    gross: float
    """Share above 5.5 mm."""

    @classmethod
    def of(cls, distances: NDArray[np.floating]) -> Self:
        """Give the figures of distances, (n,) mm, n > 0."""
        return cls(float(distances.mean()), float(distances.std()), float(np.median(distances)),
                   float(np.percentile(distances, 95)), float((distances > GROSS_MM).mean()))


def per_mm(distances: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give the share of distances per mm, (55,), between `ERROR_BINS_MM`."""
    counts, _ = np.histogram(distances, ERROR_BINS_MM)
    return np.asarray(counts / (len(distances) * np.diff(ERROR_BINS_MM)), np.float64)


def paper_distribution() -> NDArray[np.float64]:
    """Give what the paper's mean and SD allow to say of its Figure 9: the gamma distribution.

    Its bars are not known in numbers. (55,) share per mm, as in `per_mm`.
    """
    from scipy.stats import gamma

    scale = PAPER_SD_MM ** 2 / PAPER_MEAN_MM
    below = gamma.cdf(ERROR_BINS_MM, PAPER_MEAN_MM / scale, scale=scale)
    return np.asarray(np.diff(below) / np.diff(ERROR_BINS_MM), np.float64)
