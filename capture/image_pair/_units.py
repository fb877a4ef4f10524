"""What a number of a depth image stands for: said, or guessed where only one guess makes sense.

Data sets and sensors write millimetres (Kinect, Azure Kinect, ScanNet), 0.2 mm (TUM RGB-D's factor
of 5000), 0.1 mm (OpenNI2's finer format, some RealSense recordings), or metres as floats.
"""

import re
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.capture.errors import FrameError

__all__ = ["DepthCounts", "counts_of", "guess_unit", "parse_unit"]

_UNIT_MM = {"m": 1000.0, "cm": 10.0, "mm": 1.0, "um": 0.001}
_MAX_UNIT_MM = 1000.0
_MIN_UNIT_MM = 0.001
_SATURATED = 65535
"""Of 16 bits: no reading (7-Scenes and some drivers write it)."""
_COUNT_UNITS_UM = (100, 200, 500, 1000)
"""Units that depths are turned into, the first that reaches as far as they do."""
_NEAREST, _FARTHEST = 0.01, 0.99
"""Quantiles of the readings: a few may be anything."""
_FACE_MM = (300.0, 1650.0)
"""Where the nearest reading of a frame of a face is: nearer no sensor measures, farther no face
has enough readings. Whole numbers that would be there as mm would be 0.03 to 0.33 m as 0.2 or
0.1 mm, which no sensor measures."""
_FARTHEST_MM = 20_000.0
"""Beyond any sensor of this kind."""
_LEAST_FLOAT_M, _LEAST_FLOAT_MM = 0.1, 100.0
"""Of the nearest reading in metres, in millimetres."""


class DepthCounts(NamedTuple):
    """A depth as whole multiples of a unit."""

    depth: NDArray[np.uint16]
    """(H, W), 0 = no reading."""
    unit_um: int


def parse_unit(text: str) -> float:
    """Read a unit such as `mm`, `100um`, `0.2mm` or `m`: millimetres of one count.

    Raises
    ------
    ValueError
        Not a unit, or none that a depth has.
    """
    found = re.fullmatch(r"(\d+\.?\d*|\.\d+)?\s*(m|cm|mm|um|µm|μm)", text.strip(), re.IGNORECASE)
    if not found:
        raise ValueError(f"{text!r}: expected a unit such as mm, 100um, 0.2mm or m")
    name = found[2].lower().replace("µ", "u").replace("μ", "u")
    unit = float(found[1] or 1) * _UNIT_MM[name]
    if not _MIN_UNIT_MM <= unit <= _MAX_UNIT_MM:
        raise ValueError(f"{text!r}: expected a unit from 1um to 1m")
    return unit


def guess_unit(values: NDArray[Any]) -> float:
    """Guess the unit of a depth image, mm, where only one makes sense.

    Raises
    ------
    FrameError
        In words that follow the file's name: what was found, what to say.
    """
    readings = values[_measured(values)]
    if not readings.size:
        raise FrameError("no pixel has a reading")
    near, far = (float(value) for value in np.quantile(readings, (_NEAREST, _FARTHEST)))
    found = f"its readings are {near:.6g} to {far:.6g}"
    if values.dtype.kind == "f" and not (readings == np.floor(readings)).all():
        if float(readings.max()) == 1.0:
            raise FrameError(f"{found} and end at exactly 1: a depth without a scale? --unit says "
                             "what 1 stands for")
        if near >= _LEAST_FLOAT_M and far < _FARTHEST_MM / 1000:
            return 1000.0
        if near >= _LEAST_FLOAT_MM and far < _FARTHEST_MM:
            return 1.0
    elif _FACE_MM[0] <= near <= _FACE_MM[1] and far < _FARTHEST_MM:
        return 1.0
    elif values.dtype.kind == "f" and far < _FARTHEST_MM / 1000:
        return 1000.0
    raise FrameError(f"{found}, which may be of several units: --unit mm, 0.2mm (TUM RGB-D), 100um "
                     "or m says which")


def counts_of(values: NDArray[Any], unit_mm: float) -> DepthCounts:
    """Turn a depth image into whole counts.

    Whole numbers stay as they are where they can. What is not finite, not above 0, saturated or
    farther than 65 m is no reading.

    Parameters
    ----------
    values : (H, W), whole numbers or float
    unit_mm : of 1
    """
    measured = _measured(values)
    unit_um = round(unit_mm * 1000)
    whole = values.dtype.kind in "ui" and abs(unit_mm * 1000 - unit_um) < 1e-6
    if whole and unit_um <= _COUNT_UNITS_UM[-1] and values.max(initial=0) <= _SATURATED:
        counts = np.where(measured, values, 0).astype(np.uint16)
        # TUM's are whole millimetres, multiplied by 5.
        by = 1000 // unit_um
        if by > 1 and 1000 % unit_um == 0 and not (counts % by).any():
            return DepthCounts(counts // np.uint16(by), 1000)
        return DepthCounts(counts, unit_um)
    depth_um = np.where(measured, values, 0).astype(np.float64) * (unit_mm * 1000)
    most = depth_um.max(initial=0)
    to_um = next((unit for unit in _COUNT_UNITS_UM if most / unit < _SATURATED),
                 _COUNT_UNITS_UM[-1])
    counts = np.rint(depth_um / to_um)
    counts[counts >= _SATURATED] = 0
    return DepthCounts(counts.astype(np.uint16), to_um)


def _measured(values: NDArray[Any]) -> NDArray[np.bool_]:
    good = values > 0
    if values.dtype.kind == "f":
        good &= np.isfinite(values)
    elif values.dtype == np.uint16:
        good &= values != _SATURATED
    return good
