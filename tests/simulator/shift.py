"""A PrimeSense sensor's depth levels: whole shift numbers, then whole millimetres."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["EMITTER_CM", "ZPD_MM", "ZPPS_MM", "depth_levels", "depth_to_shift", "quantize",
           "shift_to_depth"]

ZPD_MM = 120.0
"""Distance of the zero plane."""
ZPPS_MM = 0.1042
"""Size of a pixel (1280 columns) on the zero plane."""
EMITTER_CM = 7.5
"""From the depth camera to the projector."""

_FIRST, _LAST = 1, 2046
_NEAREST_MM, _FARTHEST_MM = 400, 10000


def shift_to_depth(shift: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give the depth, mm, of a shift number, which need not be whole.

    As OpenNI's PS1080 driver computes its table: m = x ZPPS with x = (n - 800)/4 - 0.375,
    depth = 10 (m ZPD/(LDDIS - m) + ZPD).
    """
    m = ((np.asarray(shift, np.float64) - 800) / 4 - 0.375) * ZPPS_MM
    return 10 * (m * ZPD_MM / (EMITTER_CM - m) + ZPD_MM)


def depth_to_shift(depth_mm: NDArray[np.floating]) -> NDArray[np.float64]:
    """Give the shift number, not rounded, of a depth in mm: the inverse of `shift_to_depth`."""
    over = np.asarray(depth_mm, np.float64) / 10 - ZPD_MM
    m = over * EMITTER_CM / (ZPD_MM + over)
    return (m / ZPPS_MM + 0.375) * 4 + 800


@cache
def depth_levels() -> NDArray[np.uint16]:
    """Give the depth in whole mm of each shift number 0-2047, 0 where there is none."""
    depth = shift_to_depth(np.arange(2048.0)).astype(np.int64)
    depth[(depth < _NEAREST_MM) | (depth > _FARTHEST_MM)] = 0
    depth[:_FIRST] = depth[_LAST + 1:] = 0
    levels = depth.astype(np.uint16)
    levels.setflags(write=False)
    return levels


def quantize(shift: NDArray[np.floating]) -> NDArray[np.uint16]:
    """Round shift numbers to the sensor's levels: uint16 mm of the same shape, 0 = none."""
    whole = np.nan_to_num(np.rint(shift), nan=0.0, posinf=0.0, neginf=0.0)
    found: NDArray[np.uint16] = depth_levels()[np.clip(whole, 0, 2047).astype(np.int64)]
    return found
