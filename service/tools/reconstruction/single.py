"""One frame to one face, and what is said of it."""

from pathlib import Path
from typing import NamedTuple

from denseface.capture.image_pair import PairReading
from denseface.recon import Face, ReconstructionError, Settings, reconstruct
from denseface.service.errors import UsageError
from denseface.service.export.written import NOTHING_WRITTEN, describe
from denseface.service.runtime.terminal import complain
from denseface.service.tools.frames import (
    FrameChoice,
    NumberedFrame,
    read_frame,
    read_image_pair,
)
from denseface.service.tools.reconstruction.inputs import Input
from denseface.service.tools.reconstruction.outputs import Outputs
from denseface.service.tools.reconstruction.refused import draw_refused, explained

__all__ = ["Taken", "reconstruct_one", "take", "take_pair"]


class Taken(NamedTuple):
    """A frame that was read, and what it is called."""

    read: NumberedFrame
    shown: str
    """Where it comes from, for messages: file and number."""
    name: str
    """Of its files in a folder."""


def take(one: Input, number: int, choice: FrameChoice) -> Taken:
    """Read a frame of a file or folder; errors as `read_frame`."""
    if one.problem:
        raise UsageError(f"{one.uri}: {one.problem}")
    return Taken(read_frame(one.uri, number, choice), f"{one.uri}, frame {number}", one.name)


def take_pair(depth: Path, color: Path | None, choice: FrameChoice) -> Taken:
    """Read the frame of two image files; errors as `read_image_pair`."""
    frame = read_image_pair(depth, color, choice.calibration,
                            (choice.reading or PairReading())._replace(
                                max_pixels=choice.max_pixels), choice.rotation)
    return Taken(NumberedFrame(0, 1, frame), str(depth), depth.stem)


def reconstruct_one(taken: Taken, settings: Settings, outputs: Outputs) -> tuple[Face, list[str]]:
    """Make a face, write what is asked for, and give it with what there is to say.

    Raises
    ------
    ReconstructionError
        There is no face; the picture, where one is asked for, shows why.
    StoreError
        A file cannot be written.
    """
    frame, files = taken.read.frame, outputs.files(taken.name)
    try:
        face = reconstruct(frame, settings)
    except ReconstructionError as error:
        for note in frame.origin.notes:
            complain(f"warning: {note}")
        if files.rendering:
            draw_refused(files.rendering, frame, error, taken.shown)
        raise explained(error, taken.shown, frames=taken.read.total,
                        picture=files.rendering) from error
    files.write(face, frame)
    report = face.report
    return face, [
        f"{report.initial_points:,} measured points, {report.dense_points:,} dense points, "
        f"{report.timings_ms['total']:.0f} ms",
        *(describe(files, face) or [NOTHING_WRITTEN])]
