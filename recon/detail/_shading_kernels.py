"""The loops of shape from shading, compiled."""

from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.numerics.jit import compiled


class ShadingSystem(NamedTuple):
    """The linear least squares that a change of height is to solve: J h = residuals.

    residuals : (rows, columns), about the logarithm of brightness over shading
    jacobian_x, jacobian_y : (rows, columns), its change with dz/dx and dz/dy; once weighted, with
        the differences of the heights on both sides
    """

    residuals: Floats
    jacobian_x: Floats
    jacobian_y: Floats


class Iterate(NamedTuple):
    """What conjugate gradients carry from step to step, (rows, columns) each, changed in place.

    heights : the solution so far
    residual : what is left of the right side
    direction : of the search, before the preconditioner
    smooth_direction : the same after it
    """

    heights: Floats
    residual: Floats
    direction: Floats
    smooth_direction: Floats


@compiled
def grid_points(weight: Floats, xs: Doubles, ys: Doubles, heights: Floats) -> Floats:
    """Give the points of a grid whose weight is not zero, (n, 3), row by row."""
    points = np.empty((np.count_nonzero(weight), 3), np.float32)
    count = 0
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            if weight[i, j] != 0:
                points[count, 0], points[count, 1], points[count, 2] = xs[j], ys[i], heights[i, j]
                count += 1
    return points


@compiled
def brightness_image(
    colors: Bytes, seen: Bools, table: Floats, saturated: int, weight: Floats
) -> Floats:
    """Put the linear brightness of `grid_points` back on their grid; 0 elsewhere.

    colors : (n, 3), RGB; seen : (n,)
    table : (3, 256), the brightness of each value of each channel
    saturated : where a channel is not below it, brightness is unknown
    weight : (rows, columns), set to 0 where brightness is unknown
    """
    brightness = np.zeros(weight.shape, np.float32)
    count = 0
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            if weight[i, j] == 0:
                continue
            red, green, blue = colors[count, 0], colors[count, 1], colors[count, 2]
            if seen[count] and max(red, green, blue) < saturated:
                brightness[i, j] = table[0, red] + table[1, green] + table[2, blue]
            else:
                weight[i, j] = 0
            count += 1
    return brightness


@compiled
def masked_brightness(brightness: Floats, weight: Floats) -> Floats:
    """Give (rows, columns, 2): 1 and the brightness where the weight is above zero, else 0."""
    out = np.zeros((*weight.shape, 2), np.float32)
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            if weight[i, j] > 0:
                out[i, j, 0], out[i, j, 1] = 1, brightness[i, j]
    return out


@compiled
def shading_residuals(
    brightness: Floats, dz_dx: Floats, dz_dy: Floats, lighting: Floats, min_shading: float
) -> ShadingSystem:
    """Compare brightness b with the shading s that the lighting makes of the normals.

    Residuals are 2 (b - s) / (b + s): the logarithm of b / s within 2 % where it counts, in a
    tenth of its time.

    brightness, dz_dx, dz_dy : (rows, columns)
    lighting : (9,), of `fit_lighting`
    min_shading : less is taken for so much
    """
    rows, columns = brightness.shape
    residuals, by_dx, by_dy = (
        np.empty_like(brightness), np.empty_like(brightness), np.empty_like(brightness))
    one, two, least = np.float32(1), np.float32(2), np.float32(min_shading)
    l0, l1, l2, l3, l4, l5, l6, l7, l8 = lighting
    facing, shading = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for i in range(rows):
        # Loops write one or two rows each: with more the compiler does not vectorize them.
        along_x, along_y, seen = dz_dx[i], dz_dy[i], brightness[i]
        for j in range(np.uint64(columns)):
            p, q = along_x[j], along_y[j]
            z = one / np.sqrt(one + p * p + q * q)
            x, y = p * z, q * z
            facing[j] = z
            shading[j] = max(l0 + l1 * x + l2 * y + l3 * z + l4 * x * x + l5 * x * y + l6 * y * y
                             + l7 * x * z + l8 * y * z, least)
        out = residuals[i]
        for j in range(np.uint64(columns)):
            out[j] = two * (seen[j] - shading[j]) / (seen[j] + shading[j])
        out, other = by_dx[i], by_dy[i]
        for j in range(np.uint64(columns)):
            p, q, z = along_x[j], along_y[j], facing[j]
            x, y = p * z, q * z
            # The chain rule: z falls as x and y grow.
            by_z = l3 + l7 * x + l8 * y
            by_x = l1 + two * l4 * x + l5 * y + l7 * z - by_z * p
            by_y = l2 + l5 * x + two * l6 * y + l8 * z - by_z * q
            scale = z * z * z / shading[j]
            out[j] = scale * (by_x * (one + q * q) - by_y * p * q)
            other[j] = scale * (by_y * (one + p * p) - by_x * p * q)
    return ShadingSystem(residuals, by_dx, by_dy)


@compiled
def apply_weights(
    system: ShadingSystem, weight: Floats, energy: Floats, color_noise: float, precision: float,
    step: float,
) -> None:
    """Multiply a system by the roots of its weights, and make slopes those of differences.

    weight, energy : (rows, columns), how much a point counts, and the residuals' mean square around
    color_noise : root of the mean square above which the weight falls
    precision : 1 over the variance of a residual on even skin; step : from point to point, mm
    """
    residuals, by_x, by_y = system
    per_energy, even = np.float32(1 / color_noise**2), np.float32(precision)
    half = np.float32(1 / (2 * step))
    for i in range(residuals.shape[0]):
        for j in range(residuals.shape[1]):
            root = np.sqrt(
                even * weight[i, j] / max(per_energy * energy[i, j], np.float32(1)))
            residuals[i, j] *= root
            by_x[i, j] *= half * root
            by_y[i, j] *= half * root


@compiled
def apply_jacobian(heights: Floats, by_x: Floats, by_y: Floats, out: Floats) -> None:
    """Write J h: the heights' differences along x and y, weighted and summed.

    All (rows, columns); the outermost points of `out` are left alone.
    """
    rows, columns = heights.shape
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            out[i, j] = (by_x[i, j] * (heights[i, j + 1] - heights[i, j - 1])
                         + by_y[i, j] * (heights[i + 1, j] - heights[i - 1, j]))


@compiled
def apply_jacobian_transpose(values: Floats, by_x: Floats, by_y: Floats, out: Floats) -> None:
    """Write the transpose of `apply_jacobian` times values."""
    rows, columns = values.shape
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            out[i, j] = (by_x[i, j - 1] * values[i, j - 1] - by_x[i, j + 1] * values[i, j + 1]
                         + by_y[i - 1, j] * values[i - 1, j]
                         - by_y[i + 1, j] * values[i + 1, j])


@compiled
def conjugate_gradient_step(
    state: Iterate, smooth_residual: Floats, variance: float, by_x: Floats, by_y: Floats,
    previous: float,
) -> float:
    """Take a step of preconditioned conjugate gradients for (J^T J + C^-1) h = J^T r.

    The preconditioner is the covariance C, a blur times a variance; J is that of `apply_jacobian`.

    state : of the steps before; before any, heights and directions are zero
    smooth_residual : (rows, columns), the residual, blurred
    previous : what the step before gave; before any, any number but 0

    Gives the residual's squared norm before the step; nothing is left to find where it is 0.
    """
    heights, residual, direction, smooth_direction = state
    rows, columns = residual.shape
    factor, norm = np.float32(variance), np.float32(0)
    for i in range(rows):
        for j in range(columns):
            norm += residual[i, j] * smooth_residual[i, j]
    norm *= factor
    if norm <= 0:
        return 0.0
    beta = norm / np.float32(previous)
    for i in range(rows):
        for j in range(columns):
            direction[i, j] = beta * direction[i, j] + residual[i, j]
            smooth_direction[i, j] = beta * smooth_direction[i, j] + factor * smooth_residual[i, j]
    along, image = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
    apply_jacobian(smooth_direction, by_x, by_y, along)
    apply_jacobian_transpose(along, by_x, by_y, image)
    curvature = np.float32(0)
    for i in range(rows):
        for j in range(columns):
            image[i, j] += direction[i, j]
            curvature += smooth_direction[i, j] * image[i, j]
    length = norm / curvature
    for i in range(rows):
        for j in range(columns):
            heights[i, j] += length * smooth_direction[i, j]
            residual[i, j] -= length * image[i, j]
    return float(norm)
