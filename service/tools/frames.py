"""One frame out of a file."""

from itertools import islice
from pathlib import Path

from denseface.capture import RgbdFrame, open_source
from denseface.capture.burst import fuse
from denseface.service.errors import UsageError
from denseface.service.protocol.payload import check_frame_size

__all__ = ["read_frame"]


def read_frame(
    path: str, number: int, calibration: Path | None, max_pixels: int, burst: int = 1
) -> RgbdFrame:
    """Read a frame of a `.npz` or `.oni` file by its number, from 0.

    With `burst`, it is the mean of so many frames from that one on.

    Raises
    ------
    UsageError
        Where the path names a sensor, or there is no frame of that number.
    CaptureError
        Where the file cannot be read.
    FrameTooLargeError
        Where an image of the frame has more than `max_pixels`.
    """
    if path.startswith("openni2:"):
        raise UsageError(f"{path}: expected a .npz or .oni file; `denseface up` serves a sensor")
    with open_source(path, calibration=calibration) as source:
        count = source.frame_count
        if count is not None and not 0 <= number < count:
            raise UsageError(f"{path}: has {count} frames (0 to {count - 1}), --frame asks for "
                             f"{number}")
        frames: list[RgbdFrame] = []
        for frame in islice(source, number, number + burst):
            check_frame_size(frame, max_pixels)
            frames.append(frame)
    if not frames:
        raise UsageError(f"{path}: has fewer than {number + 1} pairs of depth and colour")
    if len(frames) < burst:
        raise UsageError(f"{path}: has {len(frames)} frames from frame {number} on, --frames asks "
                         f"for {burst}")
    return fuse(frames)
