"""The loops of shape from shading, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = [
    "apply_jacobian",
    "apply_jacobian_transpose",
    "brightness_image",
    "conjugate_gradient_step",
    "grid_points",
    "masked_brightness",
    "shading_residuals",
    "weigh",
]

Image = NDArray[np.float32]


@compiled
def grid_points(
    weight: Image, xs: NDArray[np.float64], ys: NDArray[np.float64], heights: Image
) -> Image:
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
    colors: NDArray[np.uint8], seen: NDArray[np.bool_], table: Image, full: int, weight: Image
) -> Image:
    """Put the linear brightness of `grid_points` back on their grid; 0 elsewhere.

    Parameters
    ----------
    colors : (n, 3), RGB
    seen : (n,)
    table : (3, 256), what each value of each channel adds
    full : where a channel has so much or more, it may be brighter still
    weight : (rows, columns), set to 0 where a point is not seen or too bright to tell
    """
    brightness = np.zeros(weight.shape, np.float32)
    count = 0
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            if weight[i, j] == 0:
                continue
            red, green, blue = colors[count, 0], colors[count, 1], colors[count, 2]
            if seen[count] and max(red, green, blue) < full:
                brightness[i, j] = table[0, red] + table[1, green] + table[2, blue]
            else:
                weight[i, j] = 0
            count += 1
    return brightness


@compiled
def masked_brightness(brightness: Image, weight: Image) -> Image:
    """Give (rows, columns, 2): 1, and the brightness, where the weight is not zero; else 0."""
    out = np.zeros((*weight.shape, 2), np.float32)
    for i in range(weight.shape[0]):
        for j in range(weight.shape[1]):
            if weight[i, j] > 0:
                out[i, j, 0], out[i, j, 1] = 1, brightness[i, j]
    return out


@compiled
def shading_residuals(
    brightness: Image, across: Image, down: Image, light: NDArray[np.float32], least: float,
    residuals: Image, by_across: Image, by_down: Image,
) -> None:
    """Compare brightness with what the light makes of the normals, place by place.

    Parameters
    ----------
    brightness : (rows, columns), linear
    across, down : (rows, columns), dz/dx and dz/dy
    light : (9,), as `sample_harmonics`
    least : less light is taken for so much
    residuals : written to, about the logarithm of brightness over light: 2 (a - b) / (a + b)
    by_across, by_down : written to, how the light's logarithm changes with dz/dx and dz/dy
    """
    rows, columns = brightness.shape
    one, two, least_shade = np.float32(1), np.float32(2), np.float32(least)
    l0, l1, l2, l3, l4, l5, l6, l7, l8 = light
    facing, shades = np.empty(columns, np.float32), np.empty(columns, np.float32)
    for i in range(rows):
        # Loops that write one or two rows each: of more, the compiler takes one number at a time.
        right, lower, seen = across[i], down[i], brightness[i]
        for j in range(np.uint64(columns)):
            p, q = right[j], lower[j]
            z = one / np.sqrt(one + p * p + q * q)
            x, y = p * z, q * z
            facing[j] = z
            shades[j] = max(l0 + l1 * x + l2 * y + l3 * z + l4 * x * x + l5 * x * y + l6 * y * y
                            + l7 * x * z + l8 * y * z, least_shade)
        out = residuals[i]
        for j in range(np.uint64(columns)):
            # The logarithm within 2 % where it counts, in a tenth of its time.
            out[j] = two * (seen[j] - shades[j]) / (seen[j] + shades[j])
        out, other = by_across[i], by_down[i]
        for j in range(np.uint64(columns)):
            p, q, z = right[j], lower[j], facing[j]
            x, y = p * z, q * z
            # With x, y and z one after another; z falls as x and y grow.
            by_z = l3 + l7 * x + l8 * y
            by_x = l1 + two * l4 * x + l5 * y + l7 * z - by_z * p
            by_y = l2 + l5 * x + two * l6 * y + l8 * z - by_z * q
            scale = z * z * z / shades[j]
            out[j] = scale * (by_x * (one + q * q) - by_y * p * q)
            other[j] = scale * (by_y * (one + p * p) - by_x * p * q)


@compiled
def weigh(
    residuals: Image, right: Image, lower: Image, weight: Image, energy: Image, colored: float,
    told: float, step: float,
) -> None:
    """Multiply by the root of what a place tells, and make slopes' factors those of differences.

    Parameters
    ----------
    residuals : (rows, columns), changed
    right, lower : how they change with dz/dx and dz/dy, changed to those with differences of the
        heights on both sides
    weight, energy : (rows, columns), how much a place counts, and the residuals' mean square around
    colored : root of the mean square from which on skin is of many colours
    told : how much a place of even skin tells; step : distance of places, mm
    """
    per_energy, even = np.float32(1 / colored**2), np.float32(told)
    half = np.float32(1 / (2 * step))
    for i in range(residuals.shape[0]):
        for j in range(residuals.shape[1]):
            root = np.sqrt(
                even * weight[i, j] / max(per_energy * energy[i, j], np.float32(1)))
            residuals[i, j] *= root
            right[i, j] *= half * root
            lower[i, j] *= half * root


@compiled
def apply_jacobian(heights: Image, right: Image, lower: Image, out: Image) -> None:
    """Write a height's differences along x and y, weighted by `right` and `lower`, and summed.

    All (rows, columns); the outermost places of `out` are left alone.
    """
    rows, columns = heights.shape
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            out[i, j] = (right[i, j] * (heights[i, j + 1] - heights[i, j - 1])
                         + lower[i, j] * (heights[i + 1, j] - heights[i - 1, j]))


@compiled
def apply_jacobian_transpose(values: Image, right: Image, lower: Image, out: Image) -> None:
    """Write the transpose of `apply_jacobian` times values."""
    rows, columns = values.shape
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            out[i, j] = (right[i, j - 1] * values[i, j - 1] - right[i, j + 1] * values[i, j + 1]
                         + lower[i - 1, j] * values[i - 1, j]
                         - lower[i + 1, j] * values[i + 1, j])


@compiled
def conjugate_gradient_step(
    rest: Image, smooth: Image, variance: float, right: Image, lower: Image, way: Image,
    smooth_way: Image, heights: Image, last: float,
) -> float:
    """Go a step of conjugate gradients; all are (rows, columns).

    Parameters
    ----------
    rest : what is left of the right side, changed
    smooth : the same, blurred; times the variance it is times the preconditioner
    right, lower : as of `apply_jacobian`
    way : where to, changed; smooth_way : the same times the preconditioner, kept beside it
    heights : the solution so far, changed
    last : what the step before gave; any number at first, with ways of zero

    Gives the residuals' norm before the step; where it is not above 0, there is no more to find.
    """
    rows, columns = rest.shape
    factor, now = np.float32(variance), np.float32(0)
    for i in range(rows):
        for j in range(columns):
            now += rest[i, j] * smooth[i, j]
    now *= factor
    if now <= 0:
        return 0.0
    share = now / np.float32(last)
    for i in range(rows):
        for j in range(columns):
            way[i, j] = share * way[i, j] + rest[i, j]
            smooth_way[i, j] = share * smooth_way[i, j] + factor * smooth[i, j]
    along, image = np.zeros((rows, columns), np.float32), np.zeros((rows, columns), np.float32)
    apply_jacobian(smooth_way, right, lower, along)
    apply_jacobian_transpose(along, right, lower, image)
    norm = np.float32(0)
    for i in range(rows):
        for j in range(columns):
            image[i, j] += way[i, j]
            norm += smooth_way[i, j] * image[i, j]
    length = now / norm
    for i in range(rows):
        for j in range(columns):
            heights[i, j] += length * smooth_way[i, j]
            rest[i, j] -= length * image[i, j]
    return float(now)
