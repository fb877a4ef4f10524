"""The seeds' colours: none of the background's along the outline, none where another hides it."""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Bytes
from denseface.recon.intermediate import Registration
from denseface.recon.numerics.morphology import select_pixels
from denseface.recon.numerics.push_pull import inpaint_colors
from denseface.recon.segmentation._edge_color_kernels import (
    ColorSums,
    MixtureLimits,
    box_sums,
    remove_background,
    summed_area_table,
)

_RIM = np.ones((5, 5), np.uint8)
"""How far inside the outline the background may mix into a depth pixel's colour, pixels."""
_FRAYED = np.ones((7, 7), np.uint8)
"""How far inside it a pixel may show nothing but background: the sensor's edge is frayed."""
_AROUND = np.ones((9, 9), np.uint8)
"""Window whose deepest pixel of the face tells what lies behind it, pixels."""
_INSIDE, _BESIDE, _DISTANT = 7, 25, 81
"""Sides of the windows in which the face, the background and the distant background are averaged,
pixels.

Distant background may have another colour: it is never taken off, but where none is known nearby,
as in the projector's shadow, what shows it is not the face's own.
"""
_MARGIN_PX = 16
"""Pixels around the face in which background is looked for."""
_BEHIND_MM = 25.0
"""What lies so far behind the face is background, not hair, neck or a hand."""
_LIMITS = MixtureLimits(alike=10.0, part=0.35, distant_part=0.5, aside=0.5, aside_least=10.0,
                        contrast=60.0)
"""Hair before a wall is no mixture of the face's colour and the wall's."""


def seed_colors(registered: Registration, face: Bools, solid: Bytes) -> Bytes:
    """Give the colour of each pixel of the face, (n, 3) uint8, RGB, in the order of its rows.

    Where the colour camera does not see a pixel, its neighbours' mean. Along the outline the
    background's part is taken off, and where that is large, the neighbours' mean again. Where
    nothing is measured behind and beside it, no outline is trusted.

    Parameters
    ----------
    registered : the depth tied to the colour image
    face : (H, W) bool
    solid : (H, W) uint8, 0 or 1, the same with its holes filled, which have no outline
    """
    if not face.any():
        return select_pixels(registered.colors, face)
    window = _window(face, _MARGIN_PX)
    face, solid = face[window], solid[window]
    colors = registered.colors[window].copy()
    seen = registered.visible[window] & face
    inner = seen & (cv2.erode(solid, _RIM) > 0)
    inner = inner if inner.any() else seen
    if not inner.any():
        return select_pixels(colors, face)
    deep = inner & (cv2.erode(solid, _FRAYED) > 0)
    deep = deep if deep.any() else inner
    behind = _behind(registered, window, face, solid)
    own = inner.copy()
    edge = seen & ~deep
    face_table, table = summed_area_table(colors, deep), summed_area_table(colors, behind)
    sums = ColorSums(box_sums(face_table, edge, _INSIDE // 2), box_sums(table, edge, _BESIDE // 2),
                     box_sums(table, edge, _DISTANT // 2))
    remove_background(colors, own, edge, sums, _LIMITS)
    close = _window(face, 0)
    colors, own, face = colors[close].copy(), own[close].copy(), face[close].copy()
    inpaint_colors(colors, own, face & ~own)
    return select_pixels(colors, face)


def _window(face: Bools, margin: int) -> tuple[slice, slice]:
    """The rows and columns of the face, and so many more each way."""
    rows, columns = (np.flatnonzero(face.any(axis=axis)) for axis in (1, 0))
    return (slice(max(rows[0] - margin, 0), rows[-1] + margin + 1),
            slice(max(columns[0] - margin, 0), columns[-1] + margin + 1))


def _behind(
    registered: Registration, window: tuple[slice, slice], face: Bools, solid: Bytes
) -> Bools:
    """The visible pixels beside the face that are farther than any of it nearby."""
    z = registered.points[window][..., 2]
    farthest = cv2.dilate(np.where(face, z, np.float32(0)), _AROUND)
    behind: Bools = (
        registered.visible[window] & (solid == 0) & (z > farthest + np.float32(_BEHIND_MM)))
    return behind
