"""Faces to files and pictures."""

from denseface.service.export.files import FaceFiles
from denseface.service.export.formats import FORMATS, load_face, save_face

__all__ = ["FORMATS", "FaceFiles", "load_face", "save_face"]
