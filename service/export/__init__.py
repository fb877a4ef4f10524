"""Faces to files and pictures."""

from denseface.service.export.files import FaceFiles, check_outputs, save_report
from denseface.service.export.formats import FORMATS, load_face, save_face

__all__ = ["FORMATS", "FaceFiles", "check_outputs", "load_face", "save_face",
           "save_report"]
