"""One thing at a time in a thread, its end something that a poll can wait for."""

import os
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import suppress
from typing import Generic, Self, TypeVar

__all__ = ["Background"]

_T = TypeVar("_T")


class Background(Generic[_T]):
    """Runs one call at a time in always the same thread."""

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=name)
        self._event = os.eventfd(0, os.EFD_CLOEXEC | os.EFD_NONBLOCK)
        self._future: Future[_T] | None = None
        self._started = 0.0

    def __bool__(self) -> bool:
        """Say whether a call was started and its end not yet taken."""
        return self._future is not None

    @property
    def elapsed_s(self) -> float:
        """How long the present call has taken, seconds; 0 where there is none."""
        return time.monotonic() - self._started if self._future else 0.0

    def fileno(self) -> int:
        """Give the descriptor that is readable when the call has ended."""
        return self._event

    def start(self, call: Callable[[], _T]) -> None:
        """Start a call; the one before must have been taken."""
        if self._future is not None:
            raise RuntimeError("the call before has not been taken")
        self._started = time.monotonic()
        self._future = self._pool.submit(call)
        self._future.add_done_callback(lambda _: os.eventfd_write(self._event, 1))

    def ended(self) -> bool:
        """Say whether there is an end to be taken."""
        return self._future is not None and self._future.done()

    def take(self) -> _T:
        """Wait for the call's end and give what it gave, or raise what it raised."""
        if self._future is None:
            raise RuntimeError("no call was started")
        future, self._future = self._future, None
        return future.result()

    def drain(self) -> None:
        """Forget what woke the poll; to be called before `ended` is asked."""
        with suppress(BlockingIOError):
            os.eventfd_read(self._event)

    def ends_within(self, seconds: float) -> bool:
        """Wait for the call under way, if any; False where it takes longer."""
        return self._future is None or not wait([self._future], seconds).not_done

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Wait for the call under way, if any, and end the thread."""
        self._pool.shutdown()
        os.close(self._event)
