"""Frame to face: pure functions on arrays."""

from recon.errors import (
    FaceWithoutDepthError,
    NoDepthError,
    NoFaceError,
    ReconstructionError,
    TooLittleDepthError,
)
from recon.face import DenseCloud, Face, PointCloud, Report
from recon.pipeline import reconstruct
from recon.settings import Neighbors, Preset, Settings

__all__ = [
    "DenseCloud",
    "Face",
    "FaceWithoutDepthError",
    "Neighbors",
    "NoDepthError",
    "NoFaceError",
    "PointCloud",
    "Preset",
    "ReconstructionError",
    "Report",
    "Settings",
    "TooLittleDepthError",
    "reconstruct",
]
