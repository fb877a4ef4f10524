"""Why a frame did not become a face: always one of these, never a bad cloud."""

from denseface.errors import DensefaceError
from denseface.recon.candidates import FaceCandidate

__all__ = ["CoarseDepthError", "FaceWithoutDepthError", "ImpossibleFrameError",
           "ImpossibleSettingsError", "NoDepthError", "NoFaceError", "ReconstructionError",
           "TooLittleDepthError"]


class ReconstructionError(DensefaceError):
    """Base of every error that a frame leads to.

    Attributes
    ----------
    candidates : what the detector took for a face, and what the depth said of each; empty where
        nothing looked like one, or none was looked for
    """

    candidates: tuple[FaceCandidate, ...] = ()


class ImpossibleSettingsError(DensefaceError, ValueError):
    """A setting of the reconstruction is unknown, or has a value that it may not have."""


class NoFaceError(ReconstructionError):
    """No face in the colour image, or none whose size fits its depth."""


class NoDepthError(ReconstructionError):
    """The whole depth image is empty, or nothing in it lies before the colour camera."""


class FaceWithoutDepthError(ReconstructionError):
    """A face was seen in colour, but the sensor measured no depth on it."""


class TooLittleDepthError(ReconstructionError):
    """Fewer seeds on the face than a fit needs."""


class CoarseDepthError(ReconstructionError):
    """Depth comes in steps that no face's surface can be told from."""


class ImpossibleFrameError(ReconstructionError):
    """The frame's numbers lead where no face can be: its calibration is not that of its images."""
