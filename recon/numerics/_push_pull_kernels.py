"""The steps of push-pull interpolation of colours, compiled.

Sums are (rows, columns, 4) float32: the last plane counts the colours, so that their mean is sum
over count, filtered alike.
"""

import numpy as np

from denseface.recon.arrays import Bools, Bytes, Floats
from denseface.recon.numerics.jit import compiled


@compiled
def splat_colors(colors: Bytes, coordinates: Floats, rows: int, columns: int) -> Floats:
    """Splat each colour, and a 1 beside it, on the four pixels around its coordinates, bilinear.

    colors : (n, 3); coordinates : (n, 2), (row, column), inside the image

    Returns (rows + 1, columns + 1, 4), so that no colour needs to be asked whether it is at the
    edge; the last row and column stay 0.
    """
    sums = np.zeros((rows + 1, columns + 1, 4), np.float32)
    for i in range(len(colors)):
        row, column = np.uint32(coordinates[i, 0]), np.uint32(coordinates[i, 1])
        low = coordinates[i, 0] - np.float32(row)
        right = coordinates[i, 1] - np.float32(column)
        red, green, blue = (
            np.float32(colors[i, 0]), np.float32(colors[i, 1]), np.float32(colors[i, 2]))
        for down in range(2):
            part = low if down else 1 - low
            for aside in range(2):
                weight = part * (right if aside else 1 - right)
                pixel = sums[row + down, column + aside]
                pixel[0] += weight * red
                pixel[1] += weight * green
                pixel[2] += weight * blue
                pixel[3] += weight
    return sums


@compiled
def masked_sums(image: Bytes, known: Bools) -> Floats:
    """Give the known colours of an image, (H, W, 3), and a 1 beside each; 0 elsewhere."""
    rows, columns = known.shape
    sums = np.zeros((rows, columns, 4), np.float32)
    for row in range(rows):
        for column in range(columns):
            if known[row, column]:
                for c in range(3):
                    sums[row, column, c] = image[row, column, c]
                sums[row, column, 3] = 1
    return sums


@compiled
def divide(sums: Floats, wanted: Bools, least: float) -> tuple[Floats, Bools, int]:
    """Divide the sums by their count where they are wanted and the count is more than `least`.

    Returns the means, (rows, columns, 3), 0 elsewhere; which wanted ones are missing, (rows,
    columns); and how many those are.
    """
    rows, columns = wanted.shape
    mean = np.zeros((rows, columns, 3), np.float32)
    missing = np.zeros((rows, columns), np.bool_)
    number = 0
    for row in range(rows):
        for column in range(columns):
            if wanted[row, column]:
                count = sums[row, column, 3]
                if count > least:
                    per_count = 1 / count
                    for c in range(3):
                        mean[row, column, c] = sums[row, column, c] * per_count
                else:
                    missing[row, column] = True
                    number += 1
    return mean, missing, number


@compiled
def halve(sums: Floats, missing: Bools) -> tuple[Floats, Bools]:
    """Average each four pixels, 0 outside, and say whether one of them is missing."""
    rows, columns = missing.shape
    half = np.zeros(((rows + 1) // 2, (columns + 1) // 2, 4), np.float32)
    wanted = np.zeros(half.shape[:2], np.bool_)
    quarter = np.float32(0.25)
    for row in range(rows):
        into, line = half[row // 2], sums[row]
        for column in range(columns // 2):
            for c in range(4):
                into[column, c] += quarter * (line[2 * column, c] + line[2 * column + 1, c])
        if columns % 2:
            for c in range(4):
                into[columns // 2, c] += quarter * line[columns - 1, c]
        for column in range(columns):
            if missing[row, column]:
                wanted[row // 2, column // 2] = True
    return half, wanted


@compiled
def pull(mean: Floats, missing: Bools, coarse: Floats) -> None:
    """Interpolate the missing means, (rows, columns, 3), from those at half the size, bilinear."""
    last_row, last_column = coarse.shape[0] - 1, coarse.shape[1] - 1
    quarter = np.float32(0.25)
    for row in range(mean.shape[0]):
        # A coarse pixel is centred between two fine ones.
        upper, lower = max((row - 1) // 2, 0), min((row + 1) // 2, last_row)
        down = 3 * quarter if row % 2 == 0 else quarter
        for column in range(mean.shape[1]):
            if missing[row, column]:
                left, right = max((column - 1) // 2, 0), min((column + 1) // 2, last_column)
                aside = 3 * quarter if column % 2 == 0 else quarter
                for c in range(3):
                    mean[row, column, c] = (
                        (1 - down) * ((1 - aside) * coarse[upper, left, c]
                                      + aside * coarse[upper, right, c])
                        + down * ((1 - aside) * coarse[lower, left, c]
                                  + aside * coarse[lower, right, c]))


@compiled
def set_rounded(mean: Floats, wanted: Bools, image: Bytes) -> None:
    """Set the wanted pixels of an image to the means, rounded."""
    for row in range(wanted.shape[0]):
        for column in range(wanted.shape[1]):
            if wanted[row, column]:
                for c in range(3):
                    image[row, column, c] = np.uint8(
                        np.int32(mean[row, column, c] + np.float32(0.5)))
