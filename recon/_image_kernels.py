"""The loops over the dense grid, compiled."""

import numpy as np
from numpy.typing import NDArray

from recon._compiled import compiled

__all__ = ["add_between", "blur", "box_sums", "collect", "divide", "fill", "halve", "scatter"]


@compiled
def add_between(
    image: NDArray[np.float32], coarse: NDArray[np.float32], rows: NDArray[np.float32],
    columns: NDArray[np.float32],
) -> None:
    """Add another image, bilinear, to one, (m, k).

    rows, columns : (m,), (k,), places in `coarse`, inside it
    """
    last = coarse.shape[1] - 1
    line = np.empty(last + 2, np.float32)
    for i in range(len(rows)):
        above = int(rows[i])
        below = min(above + 1, coarse.shape[0] - 1)
        part = rows[i] - np.float32(above)
        for j in range(last + 1):
            line[j] = coarse[above, j] + part * (coarse[below, j] - coarse[above, j])
        line[last + 1] = line[last]
        own = image[i]
        for j in range(len(columns)):
            left = int(columns[j])
            own[j] += line[left] + (columns[j] - np.float32(left)) * (line[left + 1] - line[left])


@compiled
def box_sums(
    colors: NDArray[np.uint8], among: NDArray[np.bool_], wanted: NDArray[np.bool_], reach: int
) -> NDArray[np.int32]:
    """Sum the colours `among` those at most `reach` rows and columns from each wanted pixel.

    Gives (n, 4), the fourth is their number; n wanted pixels, row by row.
    """
    rows, columns = among.shape
    # Sums of all that is above and left: any box is then four of them.
    total = np.zeros((rows + 1, columns + 1, 4), np.int32)
    for row in range(rows):
        line = np.zeros(4, np.int32)
        for column in range(columns):
            if among[row, column]:
                for c in range(3):
                    line[c] += colors[row, column, c]
                line[3] += 1
            for c in range(4):
                total[row + 1, column + 1, c] = total[row, column + 1, c] + line[c]
    out = np.empty((np.count_nonzero(wanted), 4), np.int32)
    i = 0
    for row in range(rows):
        for column in range(columns):
            if wanted[row, column]:
                top, bottom = max(row - reach, 0), min(row + reach + 1, rows)
                left, right = max(column - reach, 0), min(column + reach + 1, columns)
                for c in range(4):
                    out[i, c] = (total[bottom, right, c] - total[top, right, c]
                                 - total[bottom, left, c] + total[top, left, c])
                i += 1
    return out


@compiled
def scatter(
    colors: NDArray[np.uint8], places: NDArray[np.float32], rows: int, columns: int
) -> NDArray[np.float32]:
    """Share each colour, and a 1 as a fourth channel, among the four pixels around its place.

    places : (n, 2), (row, column), inside the image

    Gives (rows, columns, 4).
    """
    sums = np.zeros((rows, columns, 4), np.float32)
    for i in range(len(colors)):
        row, column = int(places[i, 0]), int(places[i, 1])
        low, right = places[i, 0] - np.float32(row), places[i, 1] - np.float32(column)
        for down in range(2):
            for across in range(2):
                weight = (low if down else 1 - low) * (right if across else 1 - right)
                if weight > 0:
                    pixel = sums[row + down, column + across]
                    for c in range(3):
                        pixel[c] += weight * colors[i, c]
                    pixel[3] += weight
    return sums


@compiled
def blur(image: NDArray[np.float32], taps: NDArray[np.float32]) -> NDArray[np.float32]:
    """Filter the rows and the columns of (rows, columns, 4) alike; zero outside.

    taps : (2 reach + 1,), symmetric
    """
    rows, columns, channels = image.shape
    reach = len(taps) // 2
    length = columns * channels
    lines = image.reshape(rows, length)
    out = np.zeros((rows, length), np.float32)
    # One row at a time stays in the processor's nearest cache.
    padded = np.zeros(length + 2 * reach * channels, np.float32)
    for row in range(rows):
        down = padded[reach * channels:reach * channels + length]
        down[:] = 0
        for k in range(max(0, reach - row), min(len(taps), rows + reach - row)):
            factor, line = taps[k], lines[row + k - reach]
            for i in range(length):
                down[i] += factor * line[i]
        across = out[row]
        for k in range(len(taps)):
            factor, line = taps[k], padded[k * channels:k * channels + length]
            for i in range(length):
                across[i] += factor * line[i]
    return out.reshape(rows, columns, channels)


@compiled
def divide(
    sums: NDArray[np.float32], wanted: NDArray[np.bool_], least: float
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Give sums[..., :3] / sums[..., 3] where that is wanted and more than `least`.

    Gives (rows, columns, 3), zero elsewhere, and (rows, columns): wanted, but too little there.
    """
    rows, columns = wanted.shape
    mean = np.zeros((rows, columns, 3), np.float32)
    missing = np.zeros((rows, columns), np.bool_)
    for row in range(rows):
        for column in range(columns):
            if wanted[row, column]:
                count = sums[row, column, 3]
                if count > least:
                    for c in range(3):
                        mean[row, column, c] = sums[row, column, c] / count
                else:
                    missing[row, column] = True
    return mean, missing


@compiled
def halve(
    sums: NDArray[np.float32], missing: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.uint8]]:
    """Give the mean of each four pixels of `sums`, and whether one of them is missing, 0 or 1.

    sums : (rows, columns, 4), zero outside; missing : (rows, columns)
    """
    rows, columns = missing.shape
    half = np.zeros(((rows + 1) // 2, (columns + 1) // 2, 4), np.float32)
    wanted = np.zeros(half.shape[:2], np.uint8)
    for row in range(rows):
        for column in range(columns):
            for c in range(4):
                half[row // 2, column // 2, c] += np.float32(0.25) * sums[row, column, c]
            wanted[row // 2, column // 2] |= missing[row, column]
    return half, wanted


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


@compiled
def collect(
    support: NDArray[np.bool_],
    xs: NDArray[np.float64],
    ys: NDArray[np.float64],
    heights: NDArray[np.float32],
    slopes_x: NDArray[np.float32],
    slopes_y: NDArray[np.float32],
    colors: NDArray[np.uint8],
    every: int,
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.uint8], NDArray[np.int32]]:
    """Gather the grid's supported points, row by row: points, normals, colours, cells.

    colors : at every so many points each way, bilinear between; one more than covers the grid
    """
    n = np.count_nonzero(support)
    points, normals = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
    rgb, cells = np.empty((n, 3), np.uint8), np.empty((n, 2), np.int32)
    line = np.empty(3 * colors.shape[1], np.float32)
    whole = np.empty(3 * support.shape[1], np.float32)
    i = 0
    for row in range(support.shape[0]):
        above = row // every
        part = np.float32(row - above * every) / np.float32(every)
        one, other = colors[above].ravel(), colors[above + 1].ravel()
        for j in range(len(line)):
            line[j] = np.float32(0.5) + one[j] + part * (np.float32(other[j]) - one[j])
        for offset in range(every):
            part = np.float32(offset) / np.float32(every)
            for left in range((support.shape[1] - 1 - offset) // every + 1):
                at = 3 * (left * every + offset)
                for c in range(3):
                    here = line[3 * left + c]
                    whole[at + c] = here + part * (line[3 * left + 3 + c] - here)
        for column in range(support.shape[1]):
            if support[row, column]:
                cells[i, 0], cells[i, 1] = row, column
                points[i, 0], points[i, 1] = xs[column], ys[row]
                points[i, 2] = heights[row, column]
                dx, dy = slopes_x[row, column], slopes_y[row, column]
                length = np.sqrt(dx * dx + dy * dy + np.float32(1))
                normals[i, 0], normals[i, 1] = dx / length, dy / length
                normals[i, 2] = np.float32(-1) / length
                for c in range(3):
                    rgb[i, c] = np.uint8(np.int32(whole[3 * column + c]))
                i += 1
    return points, normals, rgb, cells
