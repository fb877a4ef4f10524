"""Calls in a thread, one at a time, whose end a poll can wait for."""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Generic, TypeVar

from denseface.service.runtime.wake_pipe import WakePipe

__all__ = ["Background"]

_T = TypeVar("_T")
_MAX_CALLS = 2
"""One that runs and one that waits."""


class Background(WakePipe, Generic[_T]):
    """Runs one call at a time, always in the same thread.

    One more may wait: it begins when the call before ends, whether or not `result` was asked for.
    Readable when a call has ended, until `drain`, which is to be called before `done`.
    """

    def __init__(self, name: str) -> None:
        super().__init__()
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=name)
        self._calls: deque[Future[_T]] = deque()
        self._begun = 0.0

    def __bool__(self) -> bool:
        """Whether there is a call whose `result` was not yet taken."""
        return bool(self._calls)

    @property
    def elapsed_s(self) -> float:
        """Time since the present call began, seconds; 0 where there is none."""
        return time.monotonic() - self._begun if self._calls else 0.0

    def start(self, call: Callable[[], _T]) -> None:
        """Start a call, or queue it behind the one that runs; at most one may wait."""
        if len(self._calls) == _MAX_CALLS:
            raise RuntimeError("a call waits already")
        if not self._calls:
            self._begun = time.monotonic()
        future = self._pool.submit(self._run, call)
        self._calls.append(future)
        future.add_done_callback(lambda _: self.wake())

    def _run(self, call: Callable[[], _T]) -> _T:
        self._begun = time.monotonic()
        return call()

    def done(self) -> bool:
        """Whether the oldest call has ended."""
        return bool(self._calls) and self._calls[0].done()

    def result(self) -> _T:
        """Wait for the oldest call and give what it returned, or raise what it raised."""
        if not self._calls:
            raise RuntimeError("no call was started")
        return self._calls.popleft().result()

    def cancel_queued(self) -> bool:
        """Cancel the call that waits; False where there is none, or it has begun."""
        if len(self._calls) < _MAX_CALLS or not self._calls[-1].cancel():
            return False
        self._calls.pop()
        return True

    def wait(self, seconds: float) -> bool:
        """Wait for the oldest call, if any; False where it takes longer."""
        return not self._calls or not wait([self._calls[0]], seconds).not_done

    def close(self) -> None:
        """Wait for all calls and end the thread."""
        self._pool.shutdown()
        super().close()
