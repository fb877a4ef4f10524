"""Before a frame is taken: is a face there, where, how turned, how still, how lit."""

from denseface.recon.quality._measure import measure
from denseface.recon.quality._quality import FaceQuality, Quality, Sight

__all__ = ["FaceQuality", "Quality", "Sight", "measure"]
