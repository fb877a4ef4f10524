"""One frame out of a file, a folder or a pair of image files."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from denseface.capture import RgbdFrame, Source, npz, open_source
from denseface.capture.burst import fuse
from denseface.capture.calibration_files import choose_calibration
from denseface.capture.image_pair import FolderSource, ImagePairSource, PairReading
from denseface.capture.source import is_folder_of_pairs
from denseface.service.errors import UsageError
from denseface.service.protocol.payload import check_frame_size

__all__ = ["read_frame", "read_image_pair"]

_AT_ONCE = FolderSource, npz.FolderSource
"""Sources that need not read the frames before the one that is asked for."""


def read_frame(
    path: str, number: int, calibration: Path | None, max_pixels: int, burst: int = 1,
    reading: PairReading | None = None, rotation: int = 0,
) -> RgbdFrame:
    """Read a frame of a `.npz` or `.oni` file or of a folder of either kind by its number, from 0.

    Parameters
    ----------
    burst : of how many frames from that one on it is the mean
    reading : how the pairs of a folder are to be understood; None where nothing was said
    rotation : degrees by which frames are turned, clockwise

    Raises
    ------
    UsageError
        Where the path names a sensor, there is no frame of that number, or `reading` is said of
        what has no image pairs.
    CaptureError
        Where the file cannot be read, or its depth and colour do not belong together.
    FrameTooLargeError
        Where an image of the frame has more than `max_pixels`.
    """
    if path.startswith("openni2:"):
        raise UsageError(f"{path}: expected a .npz or .oni file; `denseface up` serves a sensor")
    with _opened(path, calibration, max_pixels, reading) as source:
        source.rotation = rotation
        count = source.frame_count
        if count is not None and not 0 <= number < count:
            raise UsageError(f"{path}: has {count} frames (0 to {count - 1}), --frame asks for "
                             f"{number}")
        frames: list[RgbdFrame] = []
        for frame in islice(_frames_from(source, number), burst):
            check_frame_size(frame, max_pixels)
            frames.append(frame)
    if not frames:
        raise UsageError(f"{path}: has fewer than {number + 1} pairs of depth and colour")
    if len(frames) < burst:
        raise UsageError(f"{path}: has {len(frames)} frames from frame {number} on, --frames asks "
                         f"for {burst}")
    return fuse(frames)


def read_image_pair(
    depth: Path, color: Path | None, calibration: Path | None, reading: PairReading,
    rotation: int = 0,
) -> RgbdFrame:
    """Read the frame that two image files make.

    Parameters
    ----------
    calibration : its file; None for `NAME.calibration.json` beside the depth image, if there is one
    rotation : degrees by which it is turned, clockwise

    Raises
    ------
    CaptureError
        Where a file cannot be read or is not what it should be, or both do not belong together.
    """
    chosen = choose_calibration(depth, calibration)
    with ImagePairSource(depth, color, reading._replace(chosen=chosen)) as source:
        source.rotation = rotation
        source.look_closely(refuse=True)
        return next(iter(source))


def _frames_from(source: Source, number: int) -> Iterator[RgbdFrame]:
    """Give the frames from that of a number on, the first of which must be one that fits."""
    if number == 0 or isinstance(source, _AT_ONCE):
        source.look_closely(refuse=True)
    if isinstance(source, _AT_ONCE):
        yield from source.frames_from(number)
        return
    for index, frame in enumerate(source):
        if index >= number:
            yield frame
        elif index + 1 == number:
            source.look_closely(refuse=True)


def _opened(
    path: str, calibration: Path | None, max_pixels: int, reading: PairReading | None
) -> Source:
    if is_folder_of_pairs(Path(path)):
        return FolderSource(Path(path), choose_calibration(Path(path), calibration),
                            (reading or PairReading())._replace(max_pixels=max_pixels))
    if reading is not None:
        raise UsageError(f"{path}: --unit, --rounding and --registered are for image files: a "
                         "folder of pairs, or --depth")
    return open_source(path, calibration=calibration)
