"""Frame to face: pure functions on arrays."""

from importlib import import_module
from typing import TYPE_CHECKING

from denseface.recon.errors import (
    CoarseDepthError,
    FaceWithoutDepthError,
    ImpossibleFrameError,
    NoDepthError,
    NoFaceError,
    ReconstructionError,
    TooLittleDepthError,
)
from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.recon.settings import Neighbors, Preset, Settings

if TYPE_CHECKING:
    from denseface.recon.pipeline import reconstruct
    from denseface.recon.warmup import warm

__all__ = [
    "CoarseDepthError", "DenseCloud", "Face", "FaceWithoutDepthError", "ImpossibleFrameError",
    "Neighbors", "NoDepthError", "NoFaceError", "PointCloud", "Preset", "ReconstructionError",
    "Report", "Settings", "TooLittleDepthError", "reconstruct", "warm",
]

_MODULES = {"reconstruct": "denseface.recon.pipeline", "warm": "denseface.recon.warmup"}
"""Loading OpenCV and SciPy takes most of a second, and who only handles faces needs neither."""


def __getattr__(name: str) -> object:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return __all__
