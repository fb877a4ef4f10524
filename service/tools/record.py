"""Record a source, so that whatever ends it what was recorded can be played."""

import shlex
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import cv2

from denseface.capture import CaptureError, RgbdFrame
from denseface.capture.npz import FolderWriter
from denseface.capture.oni.writer import OniWriter
from denseface.files import make_folder
from denseface.service.errors import StoreError, UsageError, reason_of
from denseface.service.log.output import exit_now
from denseface.service.runtime.files import check_outside_hub
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.terminal import complain, flush_stdout, say, suggest
from denseface.service.runtime.terminal.progress import Progress
from denseface.service.tools._recording import FrameReader

__all__ = ["run"]

_RESERVE_BYTES = 256 * 2**20
"""Of the disk that are left free: others write there, too."""
_FAILED = 1
"""Exit status where something else than its limits ended the recording."""


class _Writer(Protocol):
    path: Path
    frames: int

    def add(self, frame: RgbdFrame) -> None:
        """Append a frame; where that raises, what was there before can be played."""

    def close(self) -> None:
        """Complete what was recorded; OSError where the disk refuses a part."""


@dataclass(frozen=True)
class _End:
    """Why a recording ended."""

    why: str
    status: int = 0
    error: Exception | None = None


def run(
    uri: str, calibration: Path | None, out: Path, *, frames: int | None = None,
    seconds: float | None = None, mode: int = 0o600,
) -> int:
    """Record until so many frames or seconds, the source's end, SIGINT or SIGTERM.

    Parameters
    ----------
    out : `NAME.oni`, or a folder; neither may hold anything yet
    frames, seconds : both None: without a limit
    mode : of the files

    Returns
    -------
    exit status: 0, 130 after SIGINT, 1 where anything else ended it

    Raises
    ------
    UsageError
        `out` is there already, is of no known kind or in a hub's data folder.
    CaptureError, StoreError
        Nothing could be recorded.
    """
    cv2.setNumThreads(1)
    with StopSignal() as stop, _writing(out, mode) as writer:
        reader = FrameReader(uri, calibration)
        try:
            end = _completed(writer, _record(reader, writer, stop, _Limits(frames, seconds)))
        finally:
            hangs = not reader.close()
    if end.error is not None and not writer.frames:
        if hangs:
            complain(f"denseface record: {end.error}")
            exit_now(_FAILED)
        raise end.error
    held = f"{writer.frames} frames" if writer.frames else "nothing was recorded"
    lost = f", {reader.lost} were lost" if reader.lost else ""
    say(f"{out}: {held}{lost}; {end.why}")
    if writer.frames:
        suggest(f"denseface reconstruct {shlex.quote(str(out))} -o face.ply", "a face of it")
    if hangs:
        flush_stdout()
        exit_now(end.status)
    return end.status


class _Limits:
    """How long a recording may be."""

    def __init__(self, frames: int | None, seconds: float | None) -> None:
        self._frames, self._seconds = frames, seconds
        self._begun_s: float | None = None
        self._first_us = 0

    def seconds(self, frame: RgbdFrame | None, *, live: bool) -> float:
        """Give how long it is up to a frame: of a sensor by our clock, else by the stamps."""
        if self._begun_s is None:
            if frame is None:
                return 0.0
            self._begun_s, self._first_us = time.monotonic(), frame.depth_timestamp_us
        if live or frame is None:
            return time.monotonic() - self._begun_s
        return (frame.depth_timestamp_us - self._first_us) / 1e6

    def reached(self, frames: int, seconds: float) -> bool:
        """Whether it is as long as asked for."""
        return frames == self._frames or (self._seconds is not None and seconds >= self._seconds)


def _record(reader: FrameReader, writer: _Writer, stop: StopSignal, limits: _Limits) -> _End:
    notes: set[str] = set()
    with Progress(f"Ctrl-C ends it; recording {writer.path}") as line:
        while not stop:
            try:
                frame = reader.next()
            except EOFError:
                return _End("the source is at its end")
            except CaptureError as error:
                return _End(str(error), _FAILED, error)
            if frame is None and not writer.frames:
                line.show(lambda: f"waiting: {reader.waits_for}")
                continue
            seconds = limits.seconds(frame, live=reader.live)
            if limits.reached(writer.frames, seconds):
                return _End("as long as asked for")
            if frame is None:
                continue
            for note in set(frame.origin.notes) - notes:
                notes.add(note)
                complain(f"warning: {note}")
            if full := _no_room(writer.path):
                return _End(str(full), _FAILED, full)
            try:
                writer.add(frame)
            except CaptureError as error:
                return _End(str(error), _FAILED, error)
            except OSError as error:
                return _End(reason_of(error), _FAILED,
                            StoreError(f"{writer.path}: {reason_of(error)}"))
            line.show(lambda: f"{writer.frames} frames, {seconds:.1f} s, {reader.lost} lost")  # noqa: B023
            if limits.reached(writer.frames, seconds):
                return _End("as long as asked for")
    return _End(f"stopped by {stop.reason}", stop.exit_status)


def _completed(writer: _Writer, end: _End) -> _End:
    """Close what was recorded; where the disk refuses a part, that is why the recording failed."""
    try:
        writer.close()
    except OSError as error:
        why = f"it could not be completed: {reason_of(error)}"
        return _End(f"{end.why}; {why}", _FAILED, end.error or StoreError(f"{writer.path}: {why}"))
    return end


@contextmanager
def _writing(out: Path, mode: int) -> Iterator[_Writer]:
    """Give what writes there; it is closed in the end."""
    folder = out.is_dir() or not out.suffix
    if not folder and out.suffix.lower() != ".oni":
        raise UsageError(f"{out}: expected NAME.oni or a folder")
    if folder and out.exists() and not out.is_dir():
        raise UsageError(f"{out}: is a file, expected a folder")
    check_outside_hub(out / "000000.npz" if folder else out)
    try:
        make_folder(out.absolute().parent, mode)
        if full := _no_room(out):
            raise full
        writer: _Writer = (FolderWriter if folder else OniWriter)(out, mode)
    except FileExistsError as error:
        raise UsageError(f"{out}: there is a recording already; name another, or remove it"
                         ) from error
    except StoreError:
        raise
    except OSError as error:
        raise StoreError(f"{out}: {reason_of(error)}") from error
    try:
        yield writer
    finally:
        with suppress(OSError):  # where nothing else went wrong, it was closed before
            writer.close()


def _no_room(path: Path) -> StoreError | None:
    """Say where the disk of a file or folder is too full; None where there is room."""
    free = shutil.disk_usage(path if path.is_dir() else path.absolute().parent).free
    if free >= _RESERVE_BYTES:
        return None
    return StoreError(f"{path}: the disk is nearly full: {free >> 20} MiB are free, "
                      f"{_RESERVE_BYTES >> 20} MiB are kept free")
