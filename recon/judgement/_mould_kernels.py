"""The mean face as a surface about an axis, and a point's place on it, compiled.

A placement is a row (13,): a rotation R, row by row, from the mean face's frame to the camera's; a
translation t, mm; a scale s. A point q of the mean face stands at s R q + t.
"""

import math
from typing import NamedTuple

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.numerics.jit import inlined

__all__ = ["OFF", "Mould", "in_mould", "over_mould"]

OFF = 1e9
"""Distance of a point that lies beside the mean face."""


class Mould(NamedTuple):
    """The mean face; x right, y down, it looks toward -z.

    radius : (heights, angles) float32, mm, from the axis outward
    first_angle, angle_step : rad; 0 is the face's middle, its x is positive
    first_height, height_step : mm
    axis_z : mm, where the axis stands
    """

    radius: Floats
    first_angle: float
    angle_step: float
    first_height: float
    height_step: float
    axis_z: float


@inlined
def in_mould(point: Doubles, p: Doubles) -> tuple[float, float, float]:
    """Take a point from the camera's frame to the mean face's, by a placement."""
    x, y, z = point[0] - p[9], point[1] - p[10], point[2] - p[11]
    return ((p[0] * x + p[3] * y + p[6] * z) / p[12], (p[1] * x + p[4] * y + p[7] * z) / p[12],
            (p[2] * x + p[5] * y + p[8] * z) / p[12])


@inlined
def over_mould(
    mould: Mould, x: float, y: float, z: float
) -> tuple[float, float, float, float, float, float]:
    """Look a point of the mean face's frame up.

    Gives its distance from the mean face, mm, `OFF` beside it; the unit normal there; the angle,
    rad; and the mean face's radius there, bilinear between its samples.
    """
    back = z - mould.axis_z
    out, angle = math.sqrt(x * x + back * back), math.atan2(x, -back)
    column = (angle - mould.first_angle) / mould.angle_step
    row = (y - mould.first_height) / mould.height_step
    if not (0 <= column < mould.radius.shape[1] - 1 and 0 <= row < mould.radius.shape[0] - 1
            and out > 1):
        return OFF, 0.0, 0.0, 0.0, angle, 0.0
    j, i = int(column), int(row)
    right, down = column - j, row - i
    a, b = mould.radius[i, j], mould.radius[i, j + 1]
    c, d = mould.radius[i + 1, j], mould.radius[i + 1, j + 1]
    radius = (1 - down) * (a + right * (b - a)) + down * (c + right * (d - c))
    # Of out - radius(angle, height): the angle grows along (-back, x) / out.
    turn = ((1 - down) * (b - a) + down * (d - c)) / (mould.angle_step * out)
    nx, nz = (x + turn * back) / out, (back - turn * x) / out
    ny = -((1 - right) * (c - a) + right * (d - b)) / mould.height_step
    length = math.sqrt(nx * nx + ny * ny + nz * nz)
    return (out - radius) / length, nx / length, ny / length, nz / length, angle, radius
