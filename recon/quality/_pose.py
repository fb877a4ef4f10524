"""Where a face looks and how much of it was measured, from its own depth."""

import math
from typing import NamedTuple

import numpy as np

from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Bools, Doubles
from denseface.recon.face import Box
from denseface.recon.numerics.percentile import percentile

__all__ = ["Pose", "pose"]

_EVERY = 2
"""Every so many pixels of the face are used."""
_SEMI_AXES = (0.38, 0.48)
"""Of the ellipse that is the face, by the width of its box: inside of it all should be measured."""
_OFF_MM = 100.0
"""Depths that differ more from the middle's are not of the face."""
_PLANE_MM = 45.0
"""Radius of the part to which a plane is fitted: nose, eyes and mouth; neither ears nor neck."""
_PLANE_DEPTH_MM = 50.0
"""Depths farther from its median are left out of the fit."""
_MIN_POINTS = 60
"""Fewer tell no direction."""
_SIDES_ROWS_MM, _SIDES_MM = 50.0, 110.0
"""Height and half the width of the band in which the sides of the head are looked for."""
_SIDES_DEPTH_MM = (-50.0, 120.0)
"""Depth of that band, from the middle of the face."""
_SIDES_PERCENT = 3.0
"""Percentiles of x that are the sides, from either end."""

_TURN_BY_PLANE, _TURN_BY_SIDES = 0.55, 0.35
"""Degrees of turn for a degree of the plane's slope, and for a mm between the middle of the box and
the middle between the sides: each tells about half of it. Fitted to simulated heads."""
_TILT_BY_PLANE, _LEVEL_DEG = 0.92, 3.7
"""Degrees of tilt for a degree of the plane's slope, and the slope of a face that looks ahead."""


class Pose(NamedTuple):
    """Where a face looks, relative to the line from it to the camera."""

    coverage: float
    turn_deg: float | None
    tilt_deg: float | None


def pose(frame: RgbdFrame, box: Box, depth_mm: float) -> Pose:
    """Look at the face in a box.

    Parameters
    ----------
    frame : the frame
    box : x, y, width, height; pixels of the colour image
    depth_mm : median z in the middle of the box
    """
    x, y, w, h = box
    middle = frame.calibration.color.back_project(
        np.array([[x + (w - 1) / 2, y + (h - 1) / 2]]), depth_mm)[0]
    to_color = frame.depth_to_color
    middle = np.array(to_color.rotation).T @ (middle - to_color.translation_mm)
    width = w * depth_mm / frame.calibration.color.fx
    points, inside, measured = _readings(frame, middle, width)
    coverage = float(measured[inside].mean()) if inside.any() else 0.0
    return Pose(coverage, *_direction(points[measured], middle))


def _readings(
    frame: RgbdFrame, middle: Doubles, width_mm: float
) -> tuple[Doubles, Bools, Bools]:
    """Give the points around a face, (n, 3) mm; which are in its ellipse; which are measured."""
    camera = frame.depth_camera
    u, v = camera.project(middle[None])[0]
    reach = max(_SIDES_MM, _SEMI_AXES[1] * width_mm)
    across, along = reach * camera.fx / middle[2], reach * camera.fy / middle[2]
    rows = slice(max(int(v - along), 0), max(int(v + along) + 1, 0), _EVERY)
    columns = slice(max(int(u - across), 0), max(int(u + across) + 1, 0), _EVERY)
    unit = frame.depth_meaning.unit_um / 1000
    z = frame.depth[rows, columns].astype(np.float64) * unit
    measured = (z > 0) & (np.abs(z - middle[2]) < _OFF_MM)
    row, column = np.mgrid[rows.start:rows.start + _EVERY * z.shape[0]:_EVERY,
                           columns.start:columns.start + _EVERY * z.shape[1]:_EVERY]
    a = _SEMI_AXES[0] * width_mm * camera.fx / middle[2]
    b = _SEMI_AXES[1] * width_mm * camera.fy / middle[2]
    inside = ((column - u) / a) ** 2 + ((row - v) / b) ** 2 < 1
    rays = camera.rays()[rows, columns]
    return np.dstack([rays * z[..., None], z]), inside, measured


def _direction(points: Doubles, middle: Doubles) -> tuple[float | None, float | None]:
    """Give turn and tilt of a face whose points, (n, 3) mm, lie around its middle, (3,) mm."""
    ray = middle / np.linalg.norm(middle)
    across = np.cross((0.0, 1.0, 0.0), ray)
    across /= np.linalg.norm(across)
    axes = np.stack([across, np.cross(ray, across), ray])
    x, y, z = axes @ (points - middle).T
    core = x * x + y * y < _PLANE_MM**2
    if core.sum() < _MIN_POINTS:
        return None, None
    z = z - percentile(z[core], 50)
    core &= np.abs(z) < _PLANE_DEPTH_MM
    terms = np.stack([np.ones(core.sum()), x[core], y[core]])
    try:
        _, dx, dy = np.linalg.solve(terms @ terms.T, terms @ z[core])
    except np.linalg.LinAlgError:  # all on a line
        return None, None
    low, high = _SIDES_DEPTH_MM
    band = (np.abs(y) < _SIDES_ROWS_MM) & (np.abs(x) < _SIDES_MM) & (z > low) & (z < high)
    sides = (percentile(x[band], _SIDES_PERCENT) + percentile(x[band], 100 - _SIDES_PERCENT)) / 2
    turn = _TURN_BY_PLANE * math.degrees(math.atan(dx)) - _TURN_BY_SIDES * sides
    tilt = -_TILT_BY_PLANE * math.degrees(math.atan(dy)) - _LEVEL_DEG
    return turn, tilt
