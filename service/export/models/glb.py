"""Binary glTF 2.0: a triangle mesh that every viewer opens, coloured, textured or compact.

Not by Open3D: it writes sRGB colours as they are, while glTF wants them linear.
"""

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.export.mesh import face_mesh
from denseface.service.export.models.gltf import ARRAY, FLIP, INDICES, MM_PER_M, Gltf
from denseface.service.export.options import PLAIN, ExportOptions

__all__ = ["to_glb"]


def to_glb(face: Face, options: ExportOptions = PLAIN) -> bytes:
    """Give the bytes of a `.glb` file with the mesh of a face: metres, y up.

    Each point has a colour in linear light, or there is a texture, in sRGB as glTF has it.
    """
    if options.compact:
        from denseface.service.export.models.compact import to_compact_glb

        return to_compact_glb(face, options)
    mesh, painted = face_mesh(face.dense, options), None
    if options.texture is not None:
        from denseface.service.export.models.texture import textured

        painted = textured(mesh, options.texture)
        mesh = painted.mesh
    gltf = Gltf(face.report, options.copyright)
    named = {
        "POSITION": gltf.array((mesh.points * (FLIP / np.float32(MM_PER_M))).astype("<f4"),
                               "VEC3", ARRAY, bounds=True),
        "NORMAL": gltf.array((mesh.normals * FLIP).astype("<f4"), "VEC3", ARRAY)}
    if painted is None:
        # Not in 8 bits, too coarse for linear light in the shadows; nor in 16: MeshLab takes the
        # lower byte of each for the colour.
        named["COLOR_0"] = gltf.array(_linear(mesh.colors).astype("<f4"), "VEC3", ARRAY)
    else:
        named["TEXCOORD_0"] = gltf.array(painted.uv.astype("<f4"), "VEC2", ARRAY)
        gltf.texture(painted.jpeg)
    indices = gltf.array(mesh.triangles.astype("<u4").ravel(), "SCALAR", INDICES)
    return gltf.pack(named, indices)


def _linear(srgb: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Undo the sRGB transfer curve (IEC 61966-2-1)."""
    value = srgb / 255.0
    linear: NDArray[np.float64] = np.where(
        value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear
