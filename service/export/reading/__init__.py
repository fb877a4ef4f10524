"""Meshes and clouds from files, ours and ordinary ones of others: mm, camera frame."""

from denseface.service.export.reading.meshes import MESH_ENDINGS, Mesh, read_mesh

__all__ = ["MESH_ENDINGS", "Mesh", "read_mesh"]
