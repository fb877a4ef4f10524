"""Short names for the arrays of recon; docstrings say their shapes and units."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float32]
"""Single precision: points, images, heights."""
Doubles = NDArray[np.float64]
"""Double precision: solutions of systems, axes of grids."""
Bools = NDArray[np.bool_]
"""Masks."""
Bytes = NDArray[np.uint8]
"""Colours, and masks of 0 and 1 for OpenCV."""
Ints = NDArray[np.int32]
"""Indices and labels."""
Sizes = NDArray[np.uint64]
"""Indices that Numba need not check for being negative."""
