"""A coloured triangle mesh, the one kind of thing that the simulator renders."""

from dataclasses import dataclass, field
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["Surface"]

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False, kw_only=True)
class Surface:
    """A triangle mesh with a colour everywhere.

    Attributes
    ----------
    vertices : (n, 3) float32, mm
    faces : (m, 3) int32, indices into `vertices`
    colors : (n, 3) uint8, RGB (sRGB) at each vertex
    uv : (m, 3, 2) float32 texture coordinates of each corner, unitless, v pointing down;
        None where vertex colours are all there is
    texture : (h, w, 3) uint8, RGB (sRGB), or None
    plain : (m,) bool, triangles that take vertex colours though there is a texture
    """

    vertices: Floats
    faces: NDArray[np.int32]
    colors: NDArray[np.uint8]
    uv: Floats | None = None
    texture: NDArray[np.uint8] | None = None
    plain: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    @cached_property
    def normals(self) -> Floats:
        """Unit vertex normals, (n, 3) float32, area weighted."""
        corners = self.vertices[self.faces].astype(np.float64)
        area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        total = np.zeros(self.vertices.shape, np.float64)
        for k in range(3):
            np.add.at(total, self.faces[:, k], area)
        total /= np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)
        return total.astype(np.float32)

    def colors_at(self, triangles: NDArray[np.int64], weights: Floats) -> Floats:
        """Look up the colour of points on the mesh.

        Parameters
        ----------
        triangles : (k,) int, which triangle
        weights : (k, 3) float32, barycentric

        Returns
        -------
        (k, 3) float32, RGB (sRGB), 0-255
        """
        if self.uv is None or self.texture is None:
            return self._vertex_colors(triangles, weights)
        at = np.einsum("kc,kcd->kd", weights, self.uv[triangles])
        height, width = self.texture.shape[:2]
        colors = _sample(self.texture, at[:, 0] * width - 0.5, at[:, 1] * height - 0.5)
        if self.plain.any():
            plain = self.plain[triangles]
            colors[plain] = self._vertex_colors(triangles[plain], weights[plain])
        return colors

    def _vertex_colors(self, triangles: NDArray[np.int64], weights: Floats) -> Floats:
        found: Floats = np.einsum(
            "kc,kcd->kd", weights, self.colors[self.faces[triangles]].astype(np.float32)
        )
        return found


def _sample(image: NDArray[np.uint8], x: Floats, y: Floats) -> Floats:
    """Look an image up bilinearly at any number of places (`cv2.remap` is limited to 32767)."""
    columns = 1024
    padded = np.zeros((2, -(-len(x) // columns) * columns), np.float32)
    padded[0, :len(x)], padded[1, :len(x)] = x, y
    maps = padded.reshape(2, -1, columns)
    out = [
        cv2.remap(image, maps[0, k:k + 16384], maps[1, k:k + 16384], cv2.INTER_LINEAR,
                  borderMode=cv2.BORDER_REPLICATE)
        for k in range(0, maps.shape[1], 16384)
    ]
    if not out:
        return np.zeros((0, 3), np.float32)
    return np.concatenate(out).reshape(-1, 3)[:len(x)].astype(np.float32)
