"""One frame to one face: read, made, written, and its row; whatever goes wrong is said there."""

import errno
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from denseface.capture import RgbdFrame
from denseface.capture.errors import CaptureError
from denseface.recon import ReconstructionError, reconstruct
from denseface.service.errors import (
    FrameTooLargeError,
    StoreError,
    UsageError,
    is_full,
    reason_of,
)
from denseface.service.tools.batch.parts import Part
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.batch.row import Row, State
from denseface.service.tools.batch.summary.thumbnail import thumbnail
from denseface.service.tools.batch.worker.held import Held
from denseface.service.tools.batch.worker.records import FACES, Origin, Record, write_record
from denseface.service.tools.batch.worker.words import worker_name
from denseface.service.tools.reconstruction.refused import draw_refused

__all__ = ["ATTEMPTS", "Made", "Maker", "StoppedError"]

ATTEMPTS = 3
"""So often a frame is tried, where another try may end otherwise."""
_PASSING = {errno.EIO, errno.ESTALE, errno.ETIMEDOUT, errno.EAGAIN, errno.ENOMEM, errno.EMFILE,
            errno.ENFILE, errno.EREMOTEIO, errno.ECONNRESET, errno.ENETDOWN, errno.EBUSY}
"""What the system may say once, as of a disk in the network, and not when it is asked again."""
_OF_ONE_NAME = {errno.ENAMETOOLONG, errno.EISDIR, errno.ENOTDIR, errno.EILSEQ, errno.EINVAL}
"""What keeps one file from being written, and not the next."""
_REST = "; what follows in it is not read"


class StoppedError(Exception):
    """Nothing can be written: nor could the next frame's files.

    Attributes
    ----------
    passing : another try may end otherwise
    full : the disk has no room
    """

    def __init__(self, line: str, *, passing: bool, full: bool) -> None:
        super().__init__(line)
        self.passing, self.full = passing, full


class Made(NamedTuple):
    """What became of a frame."""

    record: Record | None = None
    """None where there is no frame of that number, or where it is to be tried `again`."""
    kept: bool = False
    """It was made before."""
    again: bool = False
    ends: bool = False
    """No further frame of this part can be read, now."""


class Maker:
    """Makes faces, as a plan says, in a folder.

    Parameters
    ----------
    folder : of the batch
    attempt : how often these frames are tried, with this time
    """

    def __init__(self, folder: Path, plan: Plan, held: Held, attempt: int) -> None:
        self._folder, self._plan, self._held, self._attempt = folder, plan, held, attempt

    def make(self, part: Part, frame: int, origin: Origin) -> Made:
        """Make a face and write it.

        Raises
        ------
        StoppedError
            A file cannot be written.
        """
        begun_s = time.perf_counter()
        number: int | None = None
        total: int | None = None

        def row(state: State, error: Exception, why: str = "", **more: Any) -> Row:
            return Row(source=part.source, frame=number, state=state,
                       error=type(error).__name__, why=why or _line(error),
                       **self._told(begun_s), **more)

        try:
            reader = self._held.reader(part, self._plan.choice)
            total = reader.count()
            if total is not None and frame >= total:
                return Made(ends=True)
            number, ends = frame, not reader.goes_on()
            read = reader.read(frame)
        except (CaptureError, FrameTooLargeError, UsageError) as error:
            opened = number is not None
            if self._may_pass(error):
                return Made(again=True, ends=not opened)
            if opened and isinstance(error, UsageError) and frame > 0:
                return Made(ends=True)  # fewer than the file said
            rest = _REST if opened and ends and (total is None or frame + 1 < total) else ""
            return Made(Record(row("unreadable", error, f"{error}{rest}"), total),
                        ends=not opened or ends)
        except Exception as error:  # of this frame alone, whatever it is
            if self._may_pass(error):
                return Made(again=True, ends=number is None)
            return Made(Record(row("failed", error), total), ends=number is None)
        try:
            return Made(self._face(part, frame, read, total, origin, row))
        except StoppedError:
            raise
        except Exception as error:
            if self._may_pass(error):
                return Made(again=True)
            return Made(Record(row("failed", error, thumbnail=_picture(read)), total))

    def _face(
        self, part: Part, frame: int, read: RgbdFrame, total: int | None, origin: Origin,
        row: Callable[..., Row],
    ) -> Record:
        """Make the face of a frame that was read."""
        begun_s = time.perf_counter()
        base = self._folder / FACES / part.named(frame)
        try:
            files = self._plan.files(base)
            try:
                face = reconstruct(read, self._plan.settings)
            except ReconstructionError as error:
                if files.rendering:
                    draw_refused(files.rendering, read, error, f"{part.source}, frame {frame}")
                record = Record(row("no_face", error, warnings=read.origin.notes,
                                    thumbnail=thumbnail(read)), total)
                written = [files.rendering]
            else:
                files.write(face, read)
                written = [files.output, *files.beside, files.report, files.rendering]
                shown = thumbnail(face)
                output = f"{FACES}/{part.named(frame)}{self._plan.ending}"
                record = Record(Row.of_face(part.source, frame, face, output=output,
                                            thumbnail=shown, **self._told(begun_s)), total)
            write_record(self._folder, part.named(frame), record, origin, filter(None, written))
        except OSError as error:  # StoreError, too
            number = _number(error)
            if number in _OF_ONE_NAME:
                raise
            line = str(error) if isinstance(error, StoreError) else (
                f"{error.filename or self._folder}: {reason_of(error)}")
            raise StoppedError(line, passing=number in _PASSING, full=is_full(number)) from error
        return record

    def _told(self, begun_s: float) -> dict[str, Any]:
        return {"seconds": time.perf_counter() - begun_s, "worker": worker_name(),
                "attempts": self._attempt}

    def _may_pass(self, error: Exception) -> bool:
        """Say whether another try may end otherwise, and is due."""
        passing = isinstance(error, MemoryError) or _number(error) in _PASSING
        return passing and self._attempt < ATTEMPTS


def _number(error: BaseException | None) -> int | None:
    """Give the system's number of an error, or of what it came from."""
    while error is not None:
        if number := getattr(error, "errno", None):
            return int(number)
        error = error.__cause__
    return None


def _line(error: Exception) -> str:
    return str(error) or type(error).__name__


def _picture(frame: RgbdFrame) -> bytes:
    try:
        return thumbnail(frame)
    except Exception:
        return b""
