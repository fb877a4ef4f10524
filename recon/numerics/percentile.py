"""Percentiles of many numbers, in a fraction of the time of NumPy's."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["percentile"]


def percentile(values: NDArray[np.floating], percent: float) -> float:
    """Give a percentile of (n,) finite numbers, n >= 1, linear between them."""
    place = (len(values) - 1) * percent / 100
    below = int(place)
    parted = np.partition(values, below)
    least = float(parted[below])
    if below == place:
        return least
    # What follows is the least of the rest.
    return least + (place - below) * (float(parted[below + 1:].min()) - least)
