"""The colour image of a frame as a picture."""

from denseface.capture.frame import RgbdFrame
from denseface.service.export._drawing import png
from denseface.service.export.provenance import frame_provenance

__all__ = ["to_photo"]


def to_photo(frame: RgbdFrame) -> bytes:
    """Give the bytes of a `.png` file; FrameError where the sensor has no colour camera."""
    return png(frame.rgb, frame_provenance(frame))
