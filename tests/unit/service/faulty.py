"""A store and a writer that fail, or wait, when a test says so."""

from collections import deque
from collections.abc import Callable

from denseface.service.errors import DiskFullError
from denseface.service.storage import (
    FolderStore,
    InlineWriter,
    PendingErasure,
    PendingWrite,
    WriteResult,
    write,
)

__all__ = ["FaultyStore", "KilledError", "StepWriter"]


class KilledError(BaseException):
    """The hub ends here."""


class FaultyStore(FolderStore):
    """Finds its disk full while `full` is set."""

    full = False

    def room(self):
        if self.full:
            raise DiskFullError("no room on the disk")

    def accept(self, *arguments):
        self.room()
        super().accept(*arguments)

    def start_attempt(self, capture_id):
        self.room()
        return super().start_attempt(capture_id)

    def finish(self, *arguments):
        self.room()
        super().finish(*arguments)

    def fail(self, *arguments):
        self.room()
        super().fail(*arguments)


class StepWriter(InlineWriter):
    """Writes when `step` says so; while `immediate`, at once. Erases at once unless it `holds`.

    Parameters
    ----------
    room : raises DiskFullError where there is none
    writes : is told of each write before it
    """

    def __init__(self, room: Callable[[], None], writes: Callable[[PendingWrite], None]) -> None:
        super().__init__()
        self.immediate = True
        self.hangs = False
        """Whether nothing that waits is ever written."""
        self.waiting: deque[PendingWrite] = deque()
        self.holds = False
        self._erasures: deque[PendingErasure] = deque()
        self._room = room
        self._writes = writes
        self._done: list[WriteResult] = []

    def start(self, pending: PendingWrite) -> None:
        self.waiting.append(pending)
        if self.immediate:
            self.wait()

    def erase(self, pending: PendingErasure) -> None:
        self._erasures.append(pending)
        if not self.holds:
            self.erase_all()

    def erase_all(self) -> None:
        """Erase what waits to be erased."""
        while self._erasures:
            super().erase(self._erasures.popleft())

    def step(self, count: int) -> None:
        """Erase all, and write that many of those that wait, as one batch."""
        self.erase_all()
        self.write(count)

    def write(self, count: int) -> None:
        """Write that many of those that wait, as one batch."""
        batch = [self.waiting.popleft() for _ in range(min(count, len(self.waiting)))]
        try:
            self._room()
        except DiskFullError as error:
            self._done += [WriteResult(pending, error=error) for pending in batch]
            return
        for pending in batch:  # before: the hub may be killed when one is written
            self._writes(pending)
        self._done += write(batch)

    def take_results(self) -> list[WriteResult]:
        done, self._done = self._done, []
        return done

    def wait(self, *, erased: bool = False, timeout_s: float | None = None) -> bool:
        if self.hangs:
            return False
        if erased:
            self.erase_all()
        self.write(len(self.waiting))
        return super().wait(erased=erased, timeout_s=timeout_s)
