"""A running service with people around it, and its history at the end."""

from collections.abc import Iterable
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

from tests.chaos.cluster import Cluster, Nursery, until
from tests.chaos.history import Answer, History
from tests.chaos.kept import read_kept
from tests.chaos.people import Follower, Listener, Presser
from tests.waiting import LIMIT_S

__all__ = ["Scene"]


class Scene:
    """A cluster, one subscriber by the client library, one to the bare publications.

    Parameters
    ----------
    options : of `Cluster`
    """

    def __init__(self, nursery: Nursery, folder: Path, source: Path, **options: Any) -> None:
        self.cluster = Cluster(nursery, folder, source, **options)
        self.follower = Follower(self.cluster.address)
        self.pressers: list[Presser] = []
        self.damaged: set[str] = set()
        self._listener = Listener(self.cluster.address)
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            for one in (self.cluster, self._listener, self.follower):
                stack.enter_context(one)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._stack.__exit__(kind, error, traceback)

    def press(self, name: str, count: int = 1, ahead: int | None = None) -> Presser:
        """Have someone press until `count` captures are accepted; see `Presser`."""
        presser = Presser(
            self.cluster.address, name, count, saw=self.follower.saw, ahead=ahead)
        self.pressers.append(presser)
        self._stack.enter_context(presser)
        return presser

    def pressed(self, within_s: float) -> None:
        """Wait until every press is answered."""
        until(lambda: all(presser.done() for presser in self.pressers),
              "an answer to each press", within_s)

    def all_seen(self) -> bool:
        """Say whether every press is answered and every accepted one was seen to end."""
        return all(presser.done() for presser in self.pressers) and all(
            self.follower.saw(capture_id) for presser in self.pressers
            for capture_id, answer in presser.answers.items() if answer is Answer.ACCEPTED)

    def settle(self, within_s: float = LIMIT_S) -> None:
        """Wait until all that was accepted was seen to end."""
        until(self.all_seen, "an end of all that was accepted", within_s)

    def finish(self) -> History:
        """Stop everything and give what is known."""
        for one in self._people():
            one.leave()
        self.cluster.stop()
        pressed: dict[str, Answer] = {}
        for presser in self.pressers:
            pressed |= presser.answers
        return History(pressed, self.follower.seen, self._listener.seen,
                       read_kept(self.cluster.data), frozenset(self.damaged))

    def _people(self) -> Iterable[Presser | Follower | Listener]:
        return (*self.pressers, self.follower, self._listener)
