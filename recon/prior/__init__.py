"""What faces can be: a statistical model of their shapes, fitted to heights."""

from denseface.recon.prior._basis import Basis, basis
from denseface.recon.prior._fit import FittedFace, HeadPose, Heights, fit_face, mean_face

__all__ = ["Basis", "FittedFace", "HeadPose", "Heights", "basis", "fit_face", "mean_face"]
