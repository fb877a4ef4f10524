"""What there is to do, in plain values: parts of sources, and tasks of them.

A task goes to another process, perhaps on another machine and by an engine that is not ours: it is
made of lists, dicts, texts and numbers alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

__all__ = ["Part", "Task"]


class Part(NamedTuple):
    """A run of frames of one source."""

    source: str
    """File or folder, absolute."""
    name: str
    """Of its faces' files below the folder of faces, without ending; or, of a source of many
    frames, of the folder that they are in."""
    many: bool
    """Whether a source of this kind may have more than one frame."""
    first: int = 0
    stop: int | None = None
    """One more than the last frame; None for all, however many there are."""
    begun: int = 0
    """Where the run began of which this is the rest: who has that open reads on."""

    def named(self, frame: int) -> str:
        """Give the name of a frame's files, below the folder of faces, without ending."""
        return f"{self.name}/{frame:05}" if self.many else self.name


@dataclass(frozen=True)
class Task:
    """What is asked of a worker at once.

    Attributes
    ----------
    folder : of the faces' folder and the records, absolute
    plan : `Plan.to_json`
    parts : one or more
    frames : most that are looked at
    seconds : after which no further frame is begun
    limit_s : that a frame may take; longer, and its worker ends
    attempt : how often these frames were given to a worker, this time included
    """

    folder: str
    plan: str
    parts: Sequence[Part]
    frames: int
    seconds: float
    limit_s: float
    attempt: int = 1

    def to_plain(self) -> dict[str, Any]:
        """Give it as plain values."""
        return {**self.__dict__, "parts": [list(part) for part in self.parts]}

    @classmethod
    def of_plain(cls, given: dict[str, Any]) -> "Task":
        """Read what `to_plain` gave."""
        return cls(**{**given, "parts": [Part(*part) for part in given["parts"]]})
