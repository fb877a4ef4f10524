"""The loops over the colours along a face's outline, compiled."""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled

__all__ = ["box_sums", "remove_background"]


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
def remove_background(
    colors: NDArray[np.uint8], own: NDArray[np.bool_], edge: NDArray[np.bool_],
    near: NDArray[np.int32], far: NDArray[np.int32], farther: NDArray[np.int32], alike: float,
    share: float, aside: float, aside_least: float, contrast: float, much: float,
) -> None:
    """Take what of the colour behind is in the edge's colours out of them.

    A colour c is taken for near + s (far - near), unless it lies aside of that line, by more than
    `aside` of the line and than `aside_least`: then s is 0. With s below `share` it becomes the
    face's own, and s (far - near) is taken out of it. One that was its own already keeps its
    colour, and with a larger s it stays its own only where near and far differ by less than
    `contrast`. Where nothing is near, or nothing far, a pixel stays as it is.

    What lies aside of that line, or has none, is not the face's own either where it lies on the
    line to `farther`, at `much` or more.

    colors : (H, W, 3); own, edge : (H, W)
    near, far, farther : (n, 4), for each pixel of the edge the sums of the colours beside it on the
        face, behind it, and behind and farther aside, and their number: `box_sums`
    alike : two colours nearer than this are not told apart
    """
    i = -1
    for row in range(edge.shape[0]):
        for column in range(edge.shape[1]):
            if not edge[row, column]:
                continue
            i += 1
            color, inner = colors[row, column], own[row, column]
            part, length, mixed = _mixture(color, near[i], far[i], alike, aside, aside_least)
            if length > 0:
                own[row, column] = part < np.float32(share) or (
                    inner and length < np.float32(contrast * contrast))
                if own[row, column] and not inner:
                    for c in range(3):
                        mean = np.float32(near[i, c]) / np.float32(near[i, 3])
                        way = np.float32(far[i, c]) / np.float32(far[i, 3]) - mean
                        cleared = np.float32(color[c]) - part * way
                        color[c] = np.uint8(
                            min(max(cleared, np.float32(0)), np.float32(255)) + np.float32(0.5))
            if own[row, column] and not mixed:
                part, length, _ = _mixture(color, near[i], farther[i], alike, aside, aside_least)
                own[row, column] = (
                    part < np.float32(much) or length < np.float32(contrast * contrast))


@compiled
def _mixture(
    color: NDArray[np.uint8], near: NDArray[np.int32], far: NDArray[np.int32], alike: float,
    aside: float, aside_least: float,
) -> tuple[np.float32, np.float32, bool]:
    """Give the share of far's mean in a colour, how far that is from near's, and whether it fits.

    The distance is squared. All are zero where one of the two is not known, the share where the
    colour lies aside of the way from one to the other.
    """
    if near[3] == 0 or far[3] == 0:
        return np.float32(0), np.float32(0), False
    # Sums alone: room for three numbers each would take longer than all of this.
    length = along = squared = np.float32(0)
    per_near, per_far = np.float32(1) / np.float32(near[3]), np.float32(1) / np.float32(far[3])
    for c in range(3):
        mean = np.float32(near[c]) * per_near
        way, off = np.float32(far[c]) * per_far - mean, np.float32(color[c]) - mean
        length += way * way
        along += way * off
        squared += off * off
    apart, length = length, max(length, np.float32(alike * alike))
    part = max(along / length, np.float32(0))
    away = squared - part * (2 * along - part * apart)
    if away > max(np.float32(aside * aside) * length, np.float32(aside_least**2)):
        return np.float32(0), length, False
    return part, length, True
