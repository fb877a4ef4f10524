"""Faces to files and pictures."""

from denseface.service.export.files import FaceFiles, check_outputs, save_report
from denseface.service.export.formats import FORMATS, load_face, save_face
from denseface.service.export.options import ExportOptions

__all__ = ["FORMATS", "ExportOptions", "FaceFiles", "check_outputs", "load_face", "save_face",
           "save_report"]
