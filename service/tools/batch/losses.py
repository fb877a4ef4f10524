"""Which frame it was that a worker ended with: a task that is lost is split until that is known.

A worker may be killed by what is in a frame, by a limit that it broke, or by somebody who meant
another process: only a frame that is lost again when it is alone is given up.
"""

from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from denseface.service.tools.batch.parts import Part
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.worker.words import Said, last_words

__all__ = ["Losses", "Unit"]

_ALONE = 2
"""So often a frame is lost when it is alone, until it is given up."""
_STRAYS = 5
"""So often a task may be lost with a worker that was at another one."""
_MOST_LEFT_BEHIND = 10_000
_MOST_GIVEN_UP = 3
"""After so many frames of a source that nobody could open yet, its rest is given up, too."""


@dataclass(frozen=True)
class Unit:
    """Frames that are sent as one task.

    Attributes
    ----------
    frames : most that are looked at
    tries : how often, this time included
    alone : how often it was lost since it is one frame
    strays : how often it was lost with a worker that was at another one
    worker : whom to prefer; empty where that is all the same
    """

    parts: Sequence[Part]
    frames: int
    tries: int = 1
    alone: int = 0
    strays: int = 0
    worker: str = ""


class Losses:
    """Splits what was lost.

    Parameters
    ----------
    folder : of the batch, where workers say what they do
    every : of a recording, each so many-th frame is taken
    """

    def __init__(self, folder: Path, every: int = 1) -> None:
        self._folder, self._every = folder, every
        self._given_up: Counter[str] = Counter()
        """Frames, by their source."""
        self.left_behind: set[str] = set()
        """Names of frames whose workers did not come back: half a file may lie beside theirs."""

    def of(self, unit: Unit) -> tuple[list[Row], list[Unit]]:
        """Give the rows of frames that are given up, and what is to be sent again."""
        frames, rest = self._frames(unit)
        said = self._said_of(frames)
        again = replace(unit, tries=unit.tries + 1, worker="")
        if said is None and unit.strays < _STRAYS:
            return [], [replace(unit, strays=unit.strays + 1, worker="")]
        rows, rest = self._without_end(rest)
        tail = [Unit(rest, unit.frames)] if rest else []
        if len(frames) > 1:
            groups = _around(frames, said) if said else (
                frames[:len(frames) // 2], frames[len(frames) // 2:])
            return rows, [*(replace(again, parts=group, frames=len(group), strays=0)
                            for group in groups if group), *tail]
        if unit.alone + 1 < _ALONE:
            return rows, [replace(again, parts=frames, frames=1, alone=unit.alone + 1, strays=0),
                          *tail]
        return [*rows, self._give_up(unit, frames[0], said)], tail

    def _frames(self, unit: Unit) -> tuple[list[Part], list[Part]]:
        """Give the frames of a unit, each as a part of its own, and what it did not come to."""
        frames: list[Part] = []
        for at, part in enumerate(unit.parts):
            if not part.many:
                frames.append(part)
                continue
            number = part.first
            while (part.stop is None or number < part.stop) and len(frames) < unit.frames:
                frames.append(part._replace(first=number, stop=number + 1, begun=number))
                number += self._every
            if part.stop is None or number < part.stop:
                return frames, [part._replace(first=number, begun=number), *unit.parts[at + 1:]]
        return frames, []

    def _said_of(self, frames: Sequence[Part]) -> Said | None:
        """Find the last words about one of these frames, and take them away."""
        asked = {(part.source, part.first) for part in frames}
        for said in last_words(self._folder):
            if (said.source, said.frame) in asked:
                if len(self.left_behind) < _MOST_LEFT_BEHIND:
                    self.left_behind.add(said.name)
                with suppress(OSError):
                    said.path.unlink()
                return said
        return None

    def _give_up(self, unit: Unit, frame: Part, said: Said | None) -> Row:
        """Say why a frame has no face."""
        if len(self._given_up) < _MOST_LEFT_BEHIND:
            self._given_up[frame.source] += 1
        error, why = (said.error, said.why) if said else (
            "WorkerLost", "its worker was lost each time")
        return Row(source=frame.source, frame=frame.first, state="failed", error=error,
                   why=f"{why} ({unit.tries} tries)", attempts=unit.tries)

    def _without_end(self, rest: list[Part]) -> tuple[list[Row], list[Part]]:
        """Leave out what goes on without an end that is known, where its frames are given up."""
        if not rest or rest[0].stop is not None:
            return [], rest
        source = rest[0].source
        if self._given_up[source] < _MOST_GIVEN_UP and len(self._given_up) < _MOST_LEFT_BEHIND:
            return [], rest
        why = f"{self._given_up[source]} of its frames ended their workers, the rest is not tried"
        return [Row(source=source, frame=None, state="failed", error="WorkerLost", why=why)
                ], rest[1:]


def _around(frames: list[Part], said: Said) -> tuple[list[Part], ...]:
    at = next(at for at, part in enumerate(frames)
              if (part.source, part.first) == (said.source, said.frame))
    return frames[:at], frames[at:at + 1], frames[at + 1:]
