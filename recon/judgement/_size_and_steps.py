"""Whether depth is fine enough for a face, and what was cut out of it is one."""

import numpy as np

from denseface.recon.arrays import Floats
from denseface.recon.errors import CoarseDepthError, NoFaceError
from denseface.recon.face import Box
from denseface.recon.numerics.percentile import percentile

__all__ = ["check_face", "check_steps"]

_WINDOW_MM = 100.0
"""Depths nearer and farther than the middle of the face by more than this are not looked at."""
_FEWEST_READINGS = 200
"""Fewer readings show no steps."""
_LOW_STEPS = 20
"""Percentile of the differences between neighbouring values that is the step: here and there a
value is missing between two."""
_STEP_AT_1_M = 2.9
"""Step of a PrimeSense sensor at 1 m, mm; it grows with the square of the depth."""
_TIMES_ITS_OWN = 2.2
"""A depth in larger steps than so many times the sensor's own went through something coarser."""
_COARSE_MM, _TOO_COARSE_MM = 4.0, 9.0
"""Steps that are said, and steps that no surface follows: seeds grow over 10 mm from pixel to
pixel. Of 6 frames with steps of 5 or 8 mm all were faces, of 15 with 10 to 40 mm one was."""

_WIDTH_MM, _HEIGHT_MM = (50.0, 280.0), (60.0, 350.0)
"""Narrowest and widest, lowest and highest of what was cut out: of 60 right frames 108 to 148 and
168 to 209."""
_MIN_AREA_MM2 = 4000.0
"""A fourth of the least of those, as of a child behind a hand."""
_MIN_RELIEF_MM = 10.0
"""Depth of what was cut out; of those frames the least has 33."""
_ENDS = (2, 98)
"""Percentiles between which it is measured."""
_SAMPLES = 4000
"""About so many seeds tell these."""


def check_steps(z: Floats, middle_mm: float) -> str:
    """Measure the steps in which depth comes.

    Parameters
    ----------
    z : (n,) float32, mm, the readings around a face
    middle_mm : depth of the face

    Returns
    -------
    a warning; empty where the steps are the sensor's own

    Raises
    ------
    CoarseDepthError
        They are too large for a face.
    """
    near = z[np.abs(z - middle_mm) < _WINDOW_MM]
    values = np.unique(near)
    if len(near) < _FEWEST_READINGS or len(values) < 2:
        return ""
    step = percentile(np.diff(values), _LOW_STEPS)
    if step < max(_COARSE_MM, _TIMES_ITS_OWN * _STEP_AT_1_M * (middle_mm / 1000) ** 2):
        return ""
    found = f"depth comes in steps of {step:.0f} mm at {middle_mm:.0f} mm"
    if step >= _TOO_COARSE_MM:
        raise CoarseDepthError(f"{found}, a face needs less than {_TOO_COARSE_MM:.0f}: was it kept "
                               "in 8 bits?")
    return f"{found}: it was made coarser than the sensor measures"


def check_face(points: Floats, pixel_mm2: float, box: Box) -> None:
    """See to it that seeds have the size and depth of a face.

    Parameters
    ----------
    points : (n, 3) float32, mm
    pixel_mm2 : what a pixel of the depth image covers at a distance of 1 mm, mm2
    box : x, y, width, height; pixels of the colour image, for the message

    Raises
    ------
    NoFaceError
        They have not.
    """
    some = points[::max(1, len(points) // _SAMPLES)].T.copy()
    width, height, relief = (
        percentile(along, _ENDS[1]) - percentile(along, _ENDS[0]) for along in some)
    area = len(points) * pixel_mm2 * percentile(some[2], 50) ** 2
    if (_WIDTH_MM[0] <= width <= _WIDTH_MM[1] and _HEIGHT_MM[0] <= height <= _HEIGHT_MM[1]
            and area >= _MIN_AREA_MM2 and relief >= _MIN_RELIEF_MM):
        return
    raise NoFaceError(
        f"no face found: what the box at {box} shows is {width:.0f} x {height:.0f} mm, measured on "
        f"{area / 100:.0f} cm2, and {relief:.0f} mm deep")
