"""Faces as closed solids for 3D printing: a relief on a plate, or a hollow mask; STL and 3MF."""

from denseface.service.export.printing.choice import Printing, check_printable

__all__ = ["Printing", "check_printable"]
