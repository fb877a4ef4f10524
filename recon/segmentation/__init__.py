"""Stage 3: the depth of the face alone, and its colours."""

from denseface.recon.segmentation._segment import box_window, segment_face

__all__ = ["box_window", "segment_face"]
