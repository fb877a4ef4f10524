"""Which tasks are sent when: few at a time, of a third of a second, of frames that follow on.

Whatever the number of frames, what is kept here is what is under way: sources are taken as there is
room for their tasks, and rows are handed on as they come.
"""

from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

from denseface.service.errors import DiskFullError, StoreError
from denseface.service.tools.batch.engines.engine import Done, Engine
from denseface.service.tools.batch.losses import Losses, Unit
from denseface.service.tools.batch.parts import Part, Task
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.sizing import LONGEST_S, FrameTimes
from denseface.service.tools.batch.worker.making import ATTEMPTS

__all__ = ["Schedule"]

_EACH = 2
"""Tasks under way for each worker: one is done, the next is at hand."""
_PIECES = 4
"""A recording that is shared out at the end gives each so many tasks, at least: who begins in the
middle must read what is before."""


@dataclass
class _Ready:
    """What is left of a task that came back."""

    part: Part
    worker: str = ""


class Schedule:
    """Sends the frames of sources to an engine until none is left.

    Parameters
    ----------
    task : all that tasks have in common
    sources : one after the other, as there is room
    losses : finds the frame that ends its worker
    gather : is given rows as they come, new ones and those that were kept
    every : of a recording, each so many-th frame is taken
    """

    def __init__(
        self, engine: Engine, task: Task, sources: Iterator[Part], losses: Losses,
        gather: Callable[[list[Row], list[Row]], None], every: int = 1,
    ) -> None:
        self._engine, self._task, self._losses, self._gather = engine, task, losses, gather
        self._sources, self._every = sources, every
        self._ready: deque[_Ready] = deque()
        self._urgent: deque[Unit] = deque()
        self._under_way: dict[int, Unit] = {}
        self._times = FrameTimes()
        self._begun = self._done = 0
        """Sources, and frames."""

    def expected(self, sources: int) -> int:
        """Say how many frames there will have been, of so many sources; an estimate at first."""
        units = *self._urgent, *self._under_way.values()
        parts = [one.part for one in self._ready] + [part for unit in units for part in unit.parts]
        frames = self._done + sum(-(-_length(part, 1) // self._every) for part in parts)
        return round(frames * max(1.0, sources / max(1, self._begun)))

    def run(self) -> None:
        """Do all.

        Raises
        ------
        DiskFullError, StoreError
            Nothing more can be written.
        EngineError
            Nothing more can be done.
        """
        self._fill()
        while self._under_way:
            for done in self._engine.completed():
                self._take(done)
                self._fill()

    def _take(self, done: Done) -> None:
        unit = self._under_way.pop(done.handle)
        if done.answer is None:
            rows, units = self._losses.of(unit)
            self._done += len(rows)
            self._gather(rows, [])
            self._urgent.extend(units)
            return
        answer = done.answer
        self._times.add(answer["looked"], answer["seconds"])
        self._done += len(answer["rows"]) + len(answer["kept"])
        self._gather(*([Row.from_dict(row) for row in answer[kind]] for kind in ("rows", "kept")))
        if answer["stop"]:
            self._stop(unit, answer)
            return
        again = [Part(*part) for part in answer["again"]]
        if again:
            self._urgent.append(Unit(again, unit.frames, unit.tries + 1))
        left = [Part(*part) for part in answer["left"]]
        if left and unit.tries > 1:  # these have their own count of tries
            self._urgent.append(replace(unit, parts=left))
        elif left:
            first, *others = left
            self._ready.extendleft(_Ready(part) for part in reversed(others))
            # What was begun is read on where it is open.
            self._ready.appendleft(_Ready(first, done.worker if first.many else ""))

    def _stop(self, unit: Unit, answer: dict[str, Any]) -> None:
        """End where nothing can be written, unless that may pass."""
        if not answer["passing"] or unit.tries >= ATTEMPTS:
            raise (DiskFullError if answer["full"] else StoreError)(answer["stop"])
        self._urgent.append(replace(unit, tries=unit.tries + 1))

    def _fill(self) -> None:
        """Send tasks until there are enough under way."""
        window = _EACH * self._engine.width
        while len(self._under_way) < window:
            unit = self._urgent.popleft() if self._urgent else self._next(window)
            if unit is None:
                return
            task = replace(self._task, parts=unit.parts, frames=unit.frames, attempt=unit.tries,
                           seconds=LONGEST_S)
            self._under_way[self._engine.submit(task.to_plain(), unit.worker)] = unit

    def _next(self, window: int) -> Unit | None:
        """Give the next frames; None where there are none left that nobody has."""
        frames = self._times.frames
        one = self._one()
        if one is None:
            return None
        parts, worker, taken = [one.part], one.worker, _length(one.part, frames)
        if not self._ready and taken >= frames:
            parts[0] = self._shared(one.part, frames, window)
        while taken < frames and (one := self._one(without_worker=True)) is not None:
            parts.append(one.part)
            taken += _length(one.part, frames)
        return Unit(parts, frames, worker=worker)

    def _one(self, *, without_worker: bool = False) -> _Ready | None:
        if self._ready:
            if without_worker and self._ready[0].worker:
                return None
            return self._ready.popleft()
        part = self._source()
        return None if part is None else _Ready(part)

    def _source(self) -> Part | None:
        part = next(self._sources, None)
        self._begun += part is not None
        return part

    def _shared(self, part: Part, frames: int, window: int) -> Part:
        """Share out what is left of a recording where nothing else is to be done."""
        if part.stop is None:
            return part
        pieces = min(window - len(self._under_way),
                     (part.stop - part.first) // (_PIECES * frames * self._every))
        if pieces < 2:
            return part
        one = self._source()
        if one is not None:
            self._ready.append(_Ready(one))
            return part
        step = -(-(part.stop - part.first) // (pieces * self._every)) * self._every
        for first in range(part.first + step, part.stop, step):
            self._ready.append(_Ready(part._replace(
                first=first, stop=min(first + step, part.stop), begun=first)))
        return part._replace(stop=part.first + step)


def _length(part: Part, unknown: int) -> int:
    """Say how many frames a part may have; so many where that is not known."""
    if not part.many:
        return 1
    return unknown if part.stop is None else part.stop - part.first
