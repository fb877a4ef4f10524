"""What a batch asks of whatever runs its tasks: three calls, so that another could stand in."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

from denseface.service.errors import ServiceError

__all__ = ["Done", "Engine", "EngineError", "Work"]

Work = Callable[[dict[str, Any]], dict[str, Any]]
"""What is called in a worker, by the name of its module, with plain values: `run_task`."""


class EngineError(ServiceError, RuntimeError):
    """The engine cannot go on: what is done stays, and the same command goes on from there."""


class Done(NamedTuple):
    """What became of a task."""

    handle: int
    answer: dict[str, Any] | None
    """None where the task was lost with its worker."""
    worker: str = ""
    """Whom to prefer for what is left of it; empty where that is all the same."""


class Engine(Protocol):
    """Runs tasks somewhere."""

    @property
    def width(self) -> int:
        """Give how many tasks run at the same time, now; at least 1."""
        ...

    def submit(self, task: dict[str, Any], worker: str = "") -> int:
        """Have a task done some time, and give a handle of it; EngineError where that fails.

        worker : which one has what the task needs at hand; another may do it as well
        """
        ...

    def completed(self) -> Iterator[Done]:
        """Give each task as it ends, also those that are submitted meanwhile, until none is left.

        Nothing of a task is kept when it was given.

        Raises
        ------
        EngineError
            No task can be done any more.
        """
        ...

    def close(self) -> None:
        """Give up all that is not done, and leave nothing behind; harmless when repeated."""
        ...
