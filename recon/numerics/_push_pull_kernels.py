"""The loops that average colours, compiled.

Sums of colours are images of four planes: the fourth counts the colours, so that a mean is sum over
count, blurred alike.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["average", "blur", "divide", "fill", "halve", "planes", "scatter", "widen"]

_SMALLEST = 4


@compiled
def scatter(
    colors: NDArray[np.uint8], places: NDArray[np.float32], rows: int, columns: int
) -> NDArray[np.float32]:
    """Share each colour, and a 1 as a fourth plane, among the four pixels around its place.

    places : (n, 2), (row, column), inside the image

    Gives (rows + 1, columns + 1, 4): nothing falls into the last row and column, but so nothing
    need be asked for each colour.
    """
    sums = np.zeros((rows + 1, columns + 1, 4), np.float32)
    for i in range(len(colors)):
        row, column = np.uint32(places[i, 0]), np.uint32(places[i, 1])
        low, right = places[i, 0] - np.float32(row), places[i, 1] - np.float32(column)
        red, green, blue = (
            np.float32(colors[i, 0]), np.float32(colors[i, 1]), np.float32(colors[i, 2]))
        for down in range(2):
            part = low if down else 1 - low
            for across in range(2):
                weight = part * (right if across else 1 - right)
                pixel = sums[row + down, column + across]
                pixel[0] += weight * red
                pixel[1] += weight * green
                pixel[2] += weight * blue
                pixel[3] += weight
    return sums


@compiled
def planes(image: NDArray[np.uint8], known: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Give the known colours of an image, and a 1 beside each; zero elsewhere: (H, W, 4)."""
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
def average(
    sums: NDArray[np.float32], wanted: NDArray[np.bool_], taps: NDArray[np.float32], least: float,
    image: NDArray[np.uint8],
) -> None:
    """Set the wanted pixels of an image, (rows, columns, 3), to the mean of the colours around.

    Sums are blurred; where what is counted is not more than `least`, the same is asked of the image
    at half its size, and so on.

    sums : (rows, columns, 4), or more; taps : of the blur
    """
    found, lacking = [], []
    asked = wanted
    while True:
        blurred = blur(sums, taps)
        smallest = max(asked.shape) <= _SMALLEST
        mean, missing, count = divide(blurred, asked, 0.0 if smallest else least)
        found.append(mean)
        lacking.append(missing)
        if count == 0 or smallest:
            break
        sums, below = halve(blurred, missing)
        asked = widen(below, 2)
    for level in range(len(found) - 2, -1, -1):
        fill(found[level], lacking[level], found[level + 1])
    mean = found[0]
    for row in range(wanted.shape[0]):
        for column in range(wanted.shape[1]):
            if wanted[row, column]:
                for c in range(3):
                    image[row, column, c] = np.uint8(
                        np.int32(mean[row, column, c] + np.float32(0.5)))


@compiled
def blur(image: NDArray[np.float32], taps: NDArray[np.float32]) -> NDArray[np.float32]:
    """Filter the rows and the columns of (rows, columns, 4) alike; zero outside.

    taps : (2 reach + 1,), symmetric
    """
    rows, columns, channels = image.shape
    reach = len(taps) // 2
    length = columns * channels
    lines = image.reshape(rows, length)
    out = np.empty((rows, length), np.float32)
    # One row at a time stays in the processor's nearest cache.
    padded = np.zeros(length + 2 * reach * channels, np.float32)
    nothing = np.zeros(length, np.float32)
    for row in range(rows):
        down = padded[reach * channels:reach * channels + length]
        factor, line = taps[reach], lines[row]
        for i in range(length):
            down[i] = factor * line[i]
        for k in range(1, min(reach, max(row, rows - 1 - row)) + 1):
            factor = taps[reach + k]
            before = lines[row - k] if k <= row else nothing
            after = lines[row + k] if row + k < rows else nothing
            for i in range(length):
                down[i] += factor * (before[i] + after[i])
        across = out[row]
        factor = taps[reach]
        for i in range(length):
            across[i] = factor * down[i]
        for k in range(1, reach + 1):
            factor = taps[reach + k]
            before = padded[(reach - k) * channels:(reach - k) * channels + length]
            after = padded[(reach + k) * channels:(reach + k) * channels + length]
            for i in range(length):
                across[i] += factor * (before[i] + after[i])
    return out.reshape(rows, columns, channels)


@compiled
def divide(
    sums: NDArray[np.float32], wanted: NDArray[np.bool_], least: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_], int]:
    """Give sums[..., :3] / sums[..., 3] where that is wanted and more than `least`.

    Gives (rows, columns, 3), zero elsewhere; (rows, columns), wanted, but too little there; and of
    how many that is so.
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
                    share = 1 / count
                    for c in range(3):
                        mean[row, column, c] = sums[row, column, c] * share
                else:
                    missing[row, column] = True
                    number += 1
    return mean, missing, number


@compiled
def halve(
    sums: NDArray[np.float32], missing: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Give the mean of each four pixels of `sums`, and whether one of them is missing.

    sums : (rows, columns, 4), zero outside; missing : (rows, columns)
    """
    rows, columns = missing.shape
    half = np.zeros(((rows + 1) // 2, (columns + 1) // 2, 4), np.float32)
    wanted = np.zeros(half.shape[:2], np.bool_)
    quarter = np.float32(0.25)
    for row in range(rows):
        above, line = half[row // 2], sums[row]
        for column in range(columns // 2):
            for c in range(4):
                above[column, c] += quarter * (line[2 * column, c] + line[2 * column + 1, c])
        if columns % 2:
            for c in range(4):
                above[columns // 2, c] += quarter * line[columns - 1, c]
        for column in range(columns):
            if missing[row, column]:
                wanted[row // 2, column // 2] = True
    return half, wanted


@compiled
def widen(mask: NDArray[np.bool_], reach: int) -> NDArray[np.bool_]:
    """Set what is at most `reach` rows and columns from what is set."""
    rows, columns = mask.shape
    out = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if mask[row, column]:
                for i in range(max(row - reach, 0), min(row + reach + 1, rows)):
                    for j in range(max(column - reach, 0), min(column + reach + 1, columns)):
                        out[i, j] = True
    return out


@compiled
def fill(
    mean: NDArray[np.float32], missing: NDArray[np.bool_], coarse: NDArray[np.float32]
) -> None:
    """Fill (rows, columns, 3) where missing from one of half its size, bilinear."""
    last_row, last_column = coarse.shape[0] - 1, coarse.shape[1] - 1
    quarter = np.float32(0.25)
    for row in range(mean.shape[0]):
        # The middle of four pixels is half a pixel from the first.
        upper, lower = max((row - 1) // 2, 0), min((row + 1) // 2, last_row)
        down = 3 * quarter if row % 2 == 0 else quarter
        for column in range(mean.shape[1]):
            if missing[row, column]:
                left, right = max((column - 1) // 2, 0), min((column + 1) // 2, last_column)
                across = 3 * quarter if column % 2 == 0 else quarter
                for c in range(3):
                    mean[row, column, c] = (
                        (1 - down) * ((1 - across) * coarse[upper, left, c]
                                      + across * coarse[upper, right, c])
                        + down * ((1 - across) * coarse[lower, left, c]
                                  + across * coarse[lower, right, c]))
