"""Frames with each preset, or faces as they are, against a truth."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.recon import Face, ReconstructionError, Settings, reconstruct
from denseface.service.errors import UsageError
from denseface.service.export import load_face
from denseface.service.tools.comparison.sides import is_face_file
from denseface.service.tools.evaluation.paper import Errors, per_mm
from denseface.service.tools.evaluation.truth import Laid, Truth
from denseface.service.tools.frames import (
    FrameChoice,
    NumberedFrame,
    UnreadFrame,
    each_frame,
    read_frame,
)
from denseface.service.tools.reconstruction.inputs import Input, find_inputs

__all__ = ["Evaluated", "Plan", "evaluate_face", "evaluate_inputs"]

_FACE = ".npz"


@dataclass(frozen=True, eq=False)
class Evaluated:
    """One face against its truth.

    Attributes
    ----------
    name : of its frame or file
    preset : that it was made with
    face : itself
    laid : how the truth lies on it
    distances : (n,) float64, mm, of the dense points from the true surface
    initial, dense : figures of both clouds
    shares : (55,) share of the dense points per mm of error
    """

    name: str
    preset: str
    face: Face
    laid: Laid
    distances: NDArray[np.float64]
    initial: Errors
    dense: Errors
    shares: NDArray[np.float64]

    @property
    def ratio(self) -> float:
        """Dense points for each initial one."""
        return len(self.face.dense) / len(self.face.initial)


class Plan(NamedTuple):
    """What is evaluated."""

    inputs: Sequence[str]
    choice: FrameChoice
    settings: Sequence[Settings]
    """Each frame is reconstructed with each."""
    number: int | None
    """Of the frame of a recording; None for all."""
    align: str


def evaluate_face(
    face: Face, name: str, truth: Truth, align: str = "auto", laid: Laid | None = None
) -> Evaluated:
    """Set a face against a truth; raises as `Truth.lay_on`.

    laid : where the truth is known to lie; else that is found
    """
    laid = laid or truth.lay_on(face, name, align)
    dense = truth.distances(face.dense.points, laid)
    initial = truth.distances(face.initial.points, laid)
    return Evaluated(name, str(face.report.settings.preset), face, laid, dense,
                     Errors.of(initial), Errors.of(dense), per_mm(dense))


def evaluate_inputs(
    plan: Plan, truth: Truth, doubt: Callable[[str], object]
) -> Iterator[Evaluated]:
    """Evaluate all inputs: frames that have no face are told to `doubt`.

    Raises
    ------
    UsageError, CaptureError, FormatError
        An input cannot be read, or the truth does not lie on a face.
    """
    for given in plan.inputs:
        path = Path(given)
        if path.is_file() and path.suffix.lower() == _FACE and is_face_file(path):
            yield evaluate_face(load_face(path), given, truth, plan.align)
            continue
        for one in find_inputs([given]):
            if one.problem:
                raise UsageError(f"{one.uri}: {one.problem}")
            yield from _of_source(one, plan, truth, doubt)


def _of_source(
    one: Input, plan: Plan, truth: Truth, doubt: Callable[[str], object]
) -> Iterator[Evaluated]:
    frames: Iterable[NumberedFrame | UnreadFrame] = (
        each_frame(one.uri, plan.choice) if plan.number is None
        else [read_frame(one.uri, plan.number, plan.choice)])
    for taken in frames:
        if isinstance(taken, UnreadFrame):
            doubt(f"{one.uri}, frame {taken.number}: {taken.problem}")
            continue
        name = one.name if taken.total == 1 else f"{one.name}_{taken.number:04}"
        laid: Laid | None = None
        for settings in plan.settings:
            try:
                face = reconstruct(taken.frame, settings)
            except ReconstructionError as error:
                doubt(f"{name}: {error}")
                continue
            found = evaluate_face(face, name, truth, plan.align, laid)
            laid = found.laid  # one place for all presets
            yield found
