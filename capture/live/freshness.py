"""Whether an image is new, or the last one once more under a new stamp."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["Freshness"]

_SAMPLED = 97
"""Every so many bytes of an image are compared: a prime, to meet all columns and channels."""
_NOISY = 10
"""Frames in a row that differ each from the one before: the sensor has noise, or a person moves."""



class Freshness:
    """Tells a new image from the one before, given again under a new stamp by a stream that froze.

    Images of a sensor have noise. Where they all differed for a while and one does not, it is no
    new image; one of a covered or simulated sensor may be like the last one for ever.
    """

    def __init__(self) -> None:
        self._before: NDArray[np.uint8] | None = None
        self._differing = 0
        self.same = False
        """Whether the last image was the one before."""

    @property
    def noisy(self) -> bool:
        """Whether each image differed from the one before, until the stream froze."""
        return self._differing >= _NOISY

    def look(self, memory: NDArray[np.uint8]) -> None:
        """Look at the next image's bytes, (n,) uint8."""
        sample = memory[::_SAMPLED].copy()
        self.same = (self._before is not None and bool(sample.any())
                     and np.array_equal(sample, self._before))
        self._before = sample
        if not self.same:
            self._differing = min(self._differing + 1, _NOISY)
        elif not self.noisy:
            self._differing = 0
