"""Many frames to faces, one after the other: each is written before the next is read."""

from collections.abc import Iterator, Sequence

from denseface.capture.errors import CaptureError
from denseface.recon import ReconstructionError, Settings, reconstruct
from denseface.service.errors import FrameTooLargeError, UsageError
from denseface.service.export.written import NOTHING_WRITTEN, WrittenFiles
from denseface.service.runtime.terminal import complain, say
from denseface.service.runtime.terminal.progress import Progress
from denseface.service.tools.frames import (
    FrameChoice,
    NumberedFrame,
    UnreadFrame,
    each_frame,
    read_frame,
)
from denseface.service.tools.reconstruction.inputs import Input
from denseface.service.tools.reconstruction.outputs import Outputs
from denseface.service.tools.reconstruction.refused import draw_refused, write_named
from denseface.service.tools.reconstruction.table import Row, Tally, head, line, to_csv

__all__ = ["reconstruct_many"]

_FAILED, _UNREADABLE = 1, 2
"""Exit statuses."""
_PLAIN_AFTER_S = 10.0
"""Until the plain line is due, where none can move, seconds: the table moves, too."""
_Taken = NumberedFrame | UnreadFrame
_DIGITS = 5
"""Of `_0007`, behind the name of a frame of several."""


def reconstruct_many(
    inputs: Sequence[Input], choice: FrameChoice, settings: Settings, outputs: Outputs,
    number: int | None,
) -> int:
    """Reconstruct frames of many sources, tell of each in a table, and give the exit status.

    0 where each frame became a face; 1 where one has no face; 2 where one could not be read. Files
    that are there are replaced. What was done before an error, or Ctrl-C, stays and is summed up.

    Parameters
    ----------
    number : of the frame that is taken of each source; None for all

    Raises
    ------
    StoreError
        A file cannot be written: nor could those of the next. The table is written all the same.
    """
    tally, written, rows = Tally(), WrittenFiles(), list[Row]()
    width = max(len(one.name) for one in inputs) + (_DIGITS if number is None else 0)
    say(head(width), flush=True)
    ended = False
    total = None if number is None else len(inputs)
    try:
        with Progress("reconstructing", total=total, unit="frames",
                      plain_after_s=_PLAIN_AFTER_S) as progress:
            for one in inputs:
                for taken in _frames(one, choice, number):
                    row = _row(_name(one, taken, outputs, number), one, taken, settings, outputs,
                               written)
                    tally.add(row)
                    if outputs.table:
                        rows.append(row)
                    say(line(row, width), flush=True)
                    progress.advance()
        ended = True
    finally:
        if outputs.table:
            write_named(outputs.table, to_csv(rows))
            written.add(outputs.table)
        say("", tally.counts() + ("" if ended else "; stopped before the end"))
        say(*tally.medians(), *written.lines(), *([] if outputs.any else [NOTHING_WRITTEN]))
        for warning, times in tally.warnings.items():
            complain(f"warning, {times} of {tally.frames} frames: {warning}")
    status = _UNREADABLE if tally.unreadable else _FAILED if tally.without else 0
    if status:
        complain(f"denseface reconstruct: {tally.frames - tally.faces} of {tally.frames} gave no "
                 "face; the table says why")
    return status


def _frames(
    one: Input, choice: FrameChoice, number: int | None
) -> Iterator[_Taken]:
    """Read the frames of a source; what cannot be opened is one frame of no number."""
    problem = f"{one.uri}: {one.problem}"
    if not one.problem:
        try:
            if number is None:
                yield from each_frame(one.uri, choice)
            else:
                yield read_frame(one.uri, number, choice)
        except (CaptureError, FrameTooLargeError, UsageError) as error:
            problem = str(error)
        else:
            return
    yield UnreadFrame(None, None, problem)


def _name(one: Input, taken: _Taken, outputs: Outputs, number: int | None) -> str:
    numbered = number is None and taken.number is not None and taken.total != 1
    return outputs.unique(f"{one.name}_{taken.number:04}" if numbered else one.name)


def _row(
    name: str, one: Input, taken: _Taken, settings: Settings, outputs: Outputs,
    written: WrittenFiles,
) -> Row:
    """Make one face and write it."""
    if isinstance(taken, UnreadFrame):
        return Row(name, one.uri, taken.number, taken.problem, unreadable=True)
    files = outputs.files(name)
    try:
        face = reconstruct(taken.frame, settings)
    except ReconstructionError as error:
        if files.rendering:
            draw_refused(files.rendering, taken.frame, error, f"{one.uri}, frame {taken.number}")
            written.add(files.rendering)
        return Row(name, one.uri, taken.number, str(error), warnings=taken.frame.origin.notes)
    files.write(face, taken.frame)
    written.add(files.output, *files.beside, files.report, files.rendering)
    return Row.of(name, one.uri, taken.number, face)
