"""Frames out of a file, a folder or a pair of image files: one, a burst, or each."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import NamedTuple

from denseface.capture import RgbdFrame, Source, npz, open_source
from denseface.capture.burst import fuse
from denseface.capture.calibration_files import choose_calibration
from denseface.capture.errors import CaptureError, UnreadableSourceError
from denseface.capture.image_pair import FolderSource, ImagePairSource, PairReading
from denseface.capture.source import is_folder_of_pairs
from denseface.service.errors import FrameTooLargeError, UsageError
from denseface.service.settings import check_frame_size

__all__ = ["FrameChoice", "FrameReader", "NumberedFrame", "UnreadFrame", "each_frame",
           "read_frame", "read_image_pair"]

_AT_ONCE = FolderSource, npz.FolderSource
"""Sources that need not read the frames before the one that is asked for."""


class FrameChoice(NamedTuple):
    """How frames are read, whatever they are read from."""

    max_pixels: int
    """Of an image."""
    calibration: Path | None = None
    """Its file, which wins over a source's own."""
    reading: PairReading | None = None
    """How the pairs of a folder are to be understood; None where nothing was said."""
    rotation: int = 0
    """Degrees by which frames are turned, clockwise."""
    burst: int = 1
    """Of how many frames from the first on a frame is the mean."""


class NumberedFrame(NamedTuple):
    """A frame, and which of its source it is."""

    number: int
    """From 0."""
    total: int | None
    """How many frames the source has at most; None where it does not know."""
    frame: RgbdFrame


class UnreadFrame(NamedTuple):
    """One that cannot be read."""

    number: int | None
    """From 0; None where its source cannot be opened."""
    total: int | None
    problem: str
    """Why not."""


def read_frame(path: str, number: int, choice: FrameChoice) -> NumberedFrame:
    """Read a frame of a `.npz` or `.oni` file or of a folder of either kind by its number, from 0.

    Raises
    ------
    UsageError
        Where there is no frame of that number, or a reading is said of what has no image pairs.
    CaptureError
        Where the file cannot be read, or its depth and colour do not belong together.
    FrameTooLargeError
        Where an image of the frame has too many pixels.
    """
    burst = choice.burst
    with _opened(path, choice) as source:
        count = source.frame_count
        _check_number(path, count, number)
        frames: list[RgbdFrame] = []
        for frame in islice(_frames_from(source, number), burst):
            check_frame_size(frame.calibration, choice.max_pixels)
            frames.append(frame)
    if not frames:
        raise UsageError(f"{path}: has fewer than {number + 1} pairs of depth and colour")
    if len(frames) < burst:
        raise UsageError(f"{path}: has {len(frames)} frames from frame {number} on, --frames asks "
                         f"for {burst}")
    return NumberedFrame(number, count, fuse(frames))


class FrameReader:
    """Reads single frames of one file or folder; of a recording on from where it is.

    What it gives is what `read_frame` gives, which begins each time at the first frame.

    Parameters
    ----------
    path, choice : as of `read_frame`; one frame is never the mean of several
    """

    def __init__(self, path: str, choice: FrameChoice) -> None:
        self._path, self._choice = path, choice
        self._source: Source | None = None
        self._frames: Iterator[RgbdFrame] = iter(())
        self._next = 0
        """Number of the frame that comes next."""

    def count(self) -> int | None:
        """Give how many frames there are at most, None where that is not known; errors likewise."""
        return self._open().frame_count

    def goes_on(self) -> bool:
        """Say whether a frame that cannot be read leaves the next ones; errors likewise."""
        return isinstance(self._open(), _AT_ONCE)

    def read(self, number: int) -> RgbdFrame:
        """Read a frame by its number, from 0; errors as `read_frame`."""
        if number < self._next:
            self.close()
        source = self._open()
        try:
            frame = self._reached(source, number)
            check_frame_size(frame.calibration, self._choice.max_pixels)
        except BaseException:
            self.close()  # what comes after an error is not known
            raise
        return frame

    def _open(self) -> Source:
        """Give the source, at its first frame where it was not open."""
        if self._source is None:
            self._source = _opened(self._path, self._choice)
            self._frames, self._next = iter(self._source), 0
        return self._source

    def close(self) -> None:
        """Close the file; a further `read` opens it again."""
        if self._source is not None:
            self._source.close()
            self._source = None

    def _reached(self, source: Source, number: int) -> RgbdFrame:
        _check_number(self._path, source.frame_count, number)
        if isinstance(source, _AT_ONCE):
            self._frames, self._next = source.frames_from(number), number
        for _ in islice(self._frames, number - self._next):
            self._next += 1
        source.look_closely(refuse=True)
        for frame in self._frames:
            self._next += 1
            return frame
        raise UsageError(f"{self._path}: has fewer than {number + 1} pairs of depth and colour")


def each_frame(path: str, choice: FrameChoice) -> Iterator[NumberedFrame | UnreadFrame]:
    """Read every frame of what `read_frame` reads, one after the other.

    One that cannot be read does not stop the others where each has a file of its own; a recording
    ends there.

    Raises
    ------
    UsageError, CaptureError
        As `read_frame`, where nothing can be read at all.
    """
    with _opened(path, choice) as source:
        count = source.frame_count
        if isinstance(source, _AT_ONCE):
            for number in range(count or 0):
                source.look_closely(refuse=True)
                yield _next(source.frames_from(number), number, count, choice.max_pixels)
            return
        frames, number = iter(source), 0
        while True:
            source.look_closely(refuse=True)
            try:
                one = _next(frames, number, count, choice.max_pixels)
            except StopIteration:
                break
            if isinstance(one, UnreadFrame) and (count is None or number + 1 < count):
                one = one._replace(problem=f"{one.problem}; what follows in it is not read")
            yield one
            number += 1
        if number == 0:
            raise UnreadableSourceError(f"{path}: holds no pair of depth and colour")


def _check_number(path: str, count: int | None, number: int) -> None:
    if count is not None and not 0 <= number < count:
        raise UsageError(f"{path}: has {count} frames (0 to {count - 1}), --frame asks for "
                         f"{number}")


def _next(
    frames: Iterator[RgbdFrame], number: int, count: int | None, max_pixels: int
) -> NumberedFrame | UnreadFrame:
    """Read the next frame; StopIteration where there is none."""
    try:
        frame = next(frames)
        check_frame_size(frame.calibration, max_pixels)
    except (CaptureError, FrameTooLargeError) as error:
        return UnreadFrame(number, count, str(error))
    return NumberedFrame(number, count, frame)


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


def _opened(path: str, choice: FrameChoice) -> Source:
    reading = choice.reading
    if is_folder_of_pairs(Path(path)):
        chosen = choose_calibration(Path(path), choice.calibration)
        source: Source = FolderSource(Path(path), chosen, (reading or PairReading())._replace(
            max_pixels=choice.max_pixels))
        source.rotation = choice.rotation
        return source
    if reading is not None:
        raise UsageError(f"{path}: --unit, --rounding and --registered are for image files: a "
                         "folder of pairs, or --depth")
    return open_source(path, calibration=choice.calibration, rotation=choice.rotation)
