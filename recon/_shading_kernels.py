"""The loops of shape from shading, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["along_light", "brightness_of", "from_along_light", "lit_places", "shade_residuals",
           "weighted_points"]

Image = NDArray[np.float32]


@compiled
def weighted_points(
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
def brightness_of(
    colors: NDArray[np.uint8], seen: NDArray[np.bool_], table: Image, full: int, weight: Image
) -> Image:
    """Put the linear brightness of `weighted_points` back on their grid; 0 elsewhere.

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
def lit_places(
    brightness: Image, weight: Image, across: Image, down: Image, every: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Give what the light is a sum of, (n, 9), and the brightness, (n,).

    Of every so many places each way whose weight is above a half: the real spherical harmonics up
    to order two of the unit normal, without their constants.

    across, down : (rows, columns), dz/dx and dz/dy
    """
    rows, columns = weight.shape
    most = (rows // every + 1) * (columns // every + 1)
    basis, seen = np.empty((most, 9)), np.empty(most)
    count = 0
    for i in range(0, rows, every):
        for j in range(0, columns, every):
            if weight[i, j] <= 0.5:
                continue
            p, q = across[i, j], down[i, j]
            z = 1 / np.sqrt(1 + p * p + q * q)
            x, y = p * z, q * z
            row = basis[count]
            row[0], row[1], row[2], row[3] = 1, x, y, z
            row[4], row[5], row[6], row[7], row[8] = x * x, x * y, y * y, x * z, y * z
            seen[count] = brightness[i, j]
            count += 1
    return basis[:count], seen[:count]


@compiled
def shade_residuals(
    brightness: Image, across: Image, down: Image, light: NDArray[np.float32], least: float,
    residuals: Image, by_across: Image, by_down: Image,
) -> None:
    """Compare brightness with what the light makes of the normals, place by place.

    Parameters
    ----------
    brightness : (rows, columns), linear
    across, down : (rows, columns), dz/dx and dz/dy
    light : (9,), as `lit_places`
    least : less light is taken for so much
    residuals : written to, about the logarithm of brightness over light: 2 (a - b) / (a + b)
    by_across, by_down : written to, how the light's logarithm changes with dz/dx and dz/dy
    """
    rows, columns = brightness.shape
    one, two, least_shade = np.float32(1), np.float32(2), np.float32(least)
    l0, l1, l2, l3, l4, l5, l6, l7, l8 = light
    for i in range(rows):
        for j in range(columns):
            p, q, seen = across[i, j], down[i, j], brightness[i, j]
            z = one / np.sqrt(one + p * p + q * q)
            x, y = p * z, q * z
            shade = max(l0 + l1 * x + l2 * y + l3 * z + l4 * x * x + l5 * x * y + l6 * y * y
                        + l7 * x * z + l8 * y * z, least_shade)
            # With x, y and z one after another; z falls as x and y grow.
            by_z = l3 + l7 * x + l8 * y
            by_x = l1 + two * l4 * x + l5 * y + l7 * z - by_z * p
            by_y = l2 + l5 * x + two * l6 * y + l8 * z - by_z * q
            scale = z * z * z / shade
            by_across[i, j] = scale * (by_x * (one + q * q) - by_y * p * q)
            by_down[i, j] = scale * (by_y * (one + p * p) - by_x * p * q)
            # The logarithm within 2 % where it counts, in a tenth of its time.
            residuals[i, j] = two * (seen - shade) / (seen + shade)


@compiled
def along_light(heights: Image, right: Image, lower: Image, out: Image) -> None:
    """Write a height's differences along x and y, weighted by `right` and `lower`, and summed.

    All (rows, columns); the outermost places of `out` are left alone.
    """
    rows, columns = heights.shape
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            out[i, j] = (right[i, j] * (heights[i, j + 1] - heights[i, j - 1])
                         + lower[i, j] * (heights[i + 1, j] - heights[i - 1, j]))


@compiled
def from_along_light(values: Image, right: Image, lower: Image, out: Image) -> None:
    """Write the transpose of `along_light` times values."""
    rows, columns = values.shape
    for i in range(1, rows - 1):
        for j in range(1, columns - 1):
            out[i, j] = (right[i, j - 1] * values[i, j - 1] - right[i, j + 1] * values[i, j + 1]
                         + lower[i - 1, j] * values[i - 1, j]
                         - lower[i + 1, j] * values[i + 1, j])
