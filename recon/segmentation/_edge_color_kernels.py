"""The background's part in the colours along a face's outline."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes, Ints
from denseface.recon.numerics.jit import compiled


class ColorSums(NamedTuple):
    """Sums of the colours around each pixel of an edge, and their number: (n, 4) int32 each."""

    face: Ints
    """Of the face beside it."""
    background: Ints
    """Of what is behind it."""
    distant: Ints
    """Of what is behind it or farther aside."""


class MixtureLimits(NamedTuple):
    """What counts as a mixture of two colours; distances are in RGB, of 255."""

    alike: float
    """Two colours nearer than this are not told apart."""
    part: float
    """With this part of the background in it, nothing of the face's own is left in a colour."""
    distant_part: float
    """The same for a background that is known from farther aside alone."""
    aside: float
    """How far a mixture may be off the line between its colours, as a part of their distance."""
    aside_least: float
    """How far it may be off where they are alike."""
    contrast: float
    """A background less different than this would not be noticed within the rim."""


def summed_area_table(colors: Bytes, mask: Bools) -> Ints:
    """Sum the masked colours, and their number, above and to the left: (H + 1, W + 1, 4) int32."""
    known = mask.view(np.uint8)
    return np.asarray(cv2.integral(cv2.copyTo(cv2.merge([colors, known]), known)), np.int32)


@compiled
def box_sums(table: Ints, wanted: Bools, reach: int) -> Ints:
    """Sum what is at most `reach` rows and columns from each wanted pixel, row by row: (n, 4)."""
    rows, columns = wanted.shape
    out = np.empty((np.count_nonzero(wanted), 4), np.int32)
    i = 0
    for row in range(rows):
        for column in range(columns):
            if wanted[row, column]:
                top, bottom = max(row - reach, 0), min(row + reach + 1, rows)
                left, right = max(column - reach, 0), min(column + reach + 1, columns)
                for c in range(4):
                    out[i, c] = (table[bottom, right, c] - table[top, right, c]
                                 - table[bottom, left, c] + table[top, left, c])
                i += 1
    return out


@compiled
def remove_background(
    colors: Bytes, own: Bools, edge: Bools, sums: ColorSums, limits: MixtureLimits
) -> None:
    """Remove the background's part from the edge's colours, and say which are the face's own.

    A colour c is taken for face + s (background - face); s is 0 where it lies off that line. With
    s below `limits.part` it becomes the face's own, and s (background - face) is taken off it. One
    that was its own already keeps its colour, and with a larger s it stays its own only where the
    contrast is low. Where face or background is unknown, a pixel stays as it is.

    A colour off that line, or without one, is not the face's own either where it lies on the line
    to the distant background, with s of `limits.distant_part` or more.

    colors : (H, W, 3), changed; own : (H, W), changed; edge : (H, W)
    """
    low = np.float32(limits.contrast * limits.contrast)
    i = -1
    for row in range(edge.shape[0]):
        for column in range(edge.shape[1]):
            if not edge[row, column]:
                continue
            i += 1
            color, inner = colors[row, column], own[row, column]
            face, behind = sums.face[i], sums.background[i]
            part, length, mixed = _unmixed(color, face, behind, limits)
            if length > 0:
                own[row, column] = part < np.float32(limits.part) or (inner and length < low)
                if own[row, column] and not inner:
                    for c in range(3):
                        mean = np.float32(face[c]) / np.float32(face[3])
                        way = np.float32(behind[c]) / np.float32(behind[3]) - mean
                        cleared = np.float32(color[c]) - part * way
                        color[c] = np.uint8(
                            min(max(cleared, np.float32(0)), np.float32(255)) + np.float32(0.5))
            if own[row, column] and not mixed:
                part, length, _ = _unmixed(color, face, sums.distant[i], limits)
                own[row, column] = part < np.float32(limits.distant_part) or length < low


@compiled
def _unmixed(
    color: Bytes, face: Ints, behind: Ints, limits: MixtureLimits
) -> tuple[np.float32, np.float32, bool]:
    """Give s of a colour, the squared distance of both means, and whether it lies on their line.

    All are zero where one of the means is unknown, s where the colour lies off the line.
    """
    if face[3] == 0 or behind[3] == 0:
        return np.float32(0), np.float32(0), False
    # Sums alone: arrays of three numbers would take longer than all of this.
    length = along = squared = np.float32(0)
    per_face, per_behind = np.float32(1) / np.float32(face[3]), np.float32(1) / np.float32(
        behind[3])
    for c in range(3):
        mean = np.float32(face[c]) * per_face
        way, off = np.float32(behind[c]) * per_behind - mean, np.float32(color[c]) - mean
        length += way * way
        along += way * off
        squared += off * off
    apart, length = length, max(length, np.float32(limits.alike * limits.alike))
    part = max(along / length, np.float32(0))
    away = squared - part * (2 * along - part * apart)
    if away > max(np.float32(limits.aside * limits.aside) * length,
                  np.float32(limits.aside_least**2)):
        return np.float32(0), length, False
    return part, length, True
