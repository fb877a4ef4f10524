"""What a worker does with a task: frames are read, faces made and written, rows come back.

The functions here are called in other processes, by the name of their module, with plain values.
"""

import socket
import threading
import time
from pathlib import Path
from typing import Any

from denseface.service.errors import StoreError, reason_of
from denseface.service.tools.batch.parts import Part, Task
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.batch.worker.held import Held
from denseface.service.tools.batch.worker.making import Made, Maker, StoppedError
from denseface.service.tools.batch.worker.records import Origin, read_record
from denseface.service.tools.batch.worker.words import LastWords

__all__ = ["prepare", "run_task"]

_one = threading.Lock()
"""A process makes one face at a time, however many threads an engine has: who limits its time ends
the process."""
_held = Held()


def prepare() -> None:
    """Load what the first frame would otherwise wait for; when repeated, does nothing."""
    import cv2

    from denseface.recon import warm
    from denseface.service.runtime.process import forbid_core_dumps

    forbid_core_dumps()
    cv2.setNumThreads(1)
    warm()


def run_task(plain: dict[str, Any]) -> dict[str, Any]:
    """Do a task, or as much of it as there is time for, and give plain values.

    Parameters
    ----------
    plain : `Task.to_plain`

    Returns
    -------
    dict
        `rows`: of the frames that were done, `Row.as_dict`; `kept`: of those that an earlier run
        did. `left`: parts that were not begun, or
        not to their end, as lists. `again`: likewise, parts whose frames another try may read.
        `looked`: at how many frames; `seconds`: that it all
        took. `stop`: why nothing can be written, `passing` whether that may pass, and `full`
        whether the disk has no room; empty where it can.

    Raises
    ------
    UsageError
        This process has another version than who sends tasks, or finds another calibration.
    StoreError
        The folder is not there.
    """
    with _one:
        prepare()
        task = Task.of_plain(plain)
        try:
            words = _held.words(Path(task.folder))
        except OSError as error:
            raise StoreError(f"{task.folder}: a worker on {socket.gethostname()} cannot write "
                             f"there: {reason_of(error)}") from error
        return _Run(task, words).run()


class _Run:
    """One task."""

    def __init__(self, task: Task, words: LastWords) -> None:
        self._task = task
        self._folder = Path(task.folder)
        self._plan = Plan.of_json(task.plan)
        self._words = words
        self._maker = Maker(self._folder, self._plan, _held, task.attempt)
        self._begun_s = time.perf_counter()
        self._longest_s = 0.0
        """Of the frames so far."""
        self._looked = 0
        self._answer: dict[str, Any] = {
            "rows": [], "kept": [], "left": [], "again": [], "stop": "", "passing": False,
            "full": False}

    def run(self) -> dict[str, Any]:
        try:
            for at, part in enumerate(self._task.parts):
                rest = self._part(part)
                if rest is not None:
                    self._answer["left"] = [list(one) for one in (rest, *self._task.parts[at + 1:])]
                    break
        except StoppedError as stopped:
            self._answer |= {"stop": str(stopped), "passing": stopped.passing, "full": stopped.full}
        return self._answer | {"looked": self._looked, "seconds": self._passed_s()}

    def _part(self, part: Part) -> Part | None:
        """Do a part; give what is left of it, None where nothing is."""
        origin = Origin.of(part.source)
        frame, stop = part.first, part.stop
        while stop is None or frame < stop:
            if self._is_over():
                return part._replace(first=frame, stop=stop)
            made = self._frame(part, frame, origin)
            if made.again:  # all that is left of it, where it could not even be opened
                self._answer["again"].append(list(part._replace(
                    first=frame, stop=stop if made.ends or not part.many else frame + 1,
                    begun=frame)))
            if made.record is not None:
                kind = "kept" if made.kept else "rows"
                self._answer[kind].append(made.record.row.as_dict())
                if made.record.total is not None:
                    total = made.record.total
                    stop = total if stop is None else min(stop, total)
            if made.ends or not part.many:
                break
            frame += self._plan.every
        _held.done_with(part, self._plan.choice)
        return None

    def _frame(self, part: Part, frame: int, origin: Origin) -> Made:
        """Make a face, where it is not there."""
        begun_s, name = time.perf_counter(), part.named(frame)
        self._looked += 1
        known = read_record(self._folder, name, origin)
        if known is not None:
            return Made(known, kept=True)
        with self._words.about(part.source, frame, name, self._task.limit_s):
            made = self._maker.make(part, frame, origin)
        self._longest_s = max(self._longest_s, time.perf_counter() - begun_s)
        return made

    def _is_over(self) -> bool:
        """Say whether there is no time for a further frame."""
        if self._looked >= self._task.frames:
            return True
        return self._looked > 0 and self._passed_s() + self._longest_s > self._task.seconds

    def _passed_s(self) -> float:
        return time.perf_counter() - self._begun_s
