"""Cut a mesh off below a level."""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from tests.simulator.surface import Surface

__all__ = ["clip_below"]


def clip_below(surface: Surface, level: float) -> Surface:
    """Keep what lies above a level (y < level, mm), cutting the triangles that cross it."""
    source, corners = _pieces(surface.vertices, surface.faces, level)
    cut = (corners != np.eye(3)).any(axis=(1, 2))
    new = np.einsum("kpc,kcd->kpd", corners[cut], surface.vertices[surface.faces[source[cut]]])
    tint = np.einsum("kpc,kcd->kpd", corners[cut],
                     surface.colors[surface.faces[source[cut]]].astype(np.float32))
    faces = surface.faces[source]
    faces[cut] = len(surface.vertices) + np.arange(3 * len(new)).reshape(-1, 3)
    return replace(
        surface, faces=faces,
        vertices=np.concatenate([surface.vertices, new.reshape(-1, 3)]).astype(np.float32),
        colors=np.concatenate([surface.colors, tint.reshape(-1, 3).astype(np.uint8)]),
        uv=None if surface.uv is None else np.einsum(
            "kpc,kcd->kpd", corners, surface.uv[source]).astype(np.float32),
        plain=surface.plain[source],
    )


def _pieces(
    vertices: NDArray[np.float32], faces: NDArray[np.int32], level: float
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """Give the triangles above a level, and the pieces of those that cross it.

    Parameters
    ----------
    vertices : (n, 3) float32, mm, y down
    faces : (m, 3) int32
    level : y, mm

    Returns
    -------
    source : (k,) int64, the triangle that each kept triangle is a piece of
    corners : (k, 3, 3) float32, barycentric weights of each kept triangle's corners in its source
    """
    below = vertices[faces][..., 1] >= level
    count = below.sum(axis=1)
    whole = np.flatnonzero(count == 0)
    source, corners = [whole], [np.broadcast_to(np.eye(3, dtype=np.float32), (len(whole), 3, 3))]
    for odd, crossing in ((False, np.flatnonzero(count == 2)), (True, np.flatnonzero(count == 1))):
        # The corner that is alone on its side, and the two others in winding order.
        alone = np.argmax(below[crossing] == odd, axis=1)
        a, b, c = (np.eye(3, dtype=np.float32)[(alone + k) % 3] for k in range(3))
        y = vertices[faces[crossing]][..., 1]
        ya, yb, yc = (np.take_along_axis(y, ((alone + k) % 3)[:, None], axis=1) for k in range(3))
        on_ab = a + (level - ya) / (yb - ya) * (b - a)
        on_ac = a + (level - ya) / (yc - ya) * (c - a)
        pieces = [(on_ab, b, c), (on_ab, c, on_ac)] if odd else [(a, on_ab, on_ac)]
        for piece in pieces:
            source.append(crossing)
            corners.append(np.stack(piece, axis=1))
    return np.concatenate(source), np.concatenate(corners).astype(np.float32)
