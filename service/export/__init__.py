"""Faces to files and pictures."""

from denseface.service.export.files import FaceFiles
from denseface.service.export.formats import FORMATS, check_ending, load_face, save_face

__all__ = ["FORMATS", "FaceFiles", "check_ending", "load_face", "save_face"]
