"""One thing at a time in a thread, its end something that a poll can wait for."""

import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from typing import Generic, TypeVar

from denseface.service.runtime.closing import Closing
from denseface.service.runtime.wake_pipe import WakePipe

__all__ = ["Background"]

_T = TypeVar("_T")
_MOST = 2


class Background(Closing, Generic[_T]):
    """Runs one call at a time in always the same thread.

    One more may wait: it begins as soon as the one before ends, whether or not that was taken.
    """

    def __init__(self, name: str) -> None:
        self._pool = ThreadPoolExecutor(1, thread_name_prefix=name)
        self._wake = WakePipe()
        self._calls: deque[Future[_T]] = deque()
        self._begun = 0.0

    def __bool__(self) -> bool:
        """Say whether a call was started and its end not yet taken."""
        return bool(self._calls)

    @property
    def elapsed_s(self) -> float:
        """How long the present call has taken, seconds; 0 where there is none."""
        return time.monotonic() - self._begun if self._calls else 0.0

    def fileno(self) -> int:
        """Give the descriptor that is readable when the call has ended."""
        return self._wake.fileno()

    def start(self, call: Callable[[], _T]) -> None:
        """Start a call, behind the one that is under way; at most one may wait so."""
        if len(self._calls) == _MOST:
            raise RuntimeError("a call waits already")
        if not self._calls:
            self._begun = time.monotonic()
        future = self._pool.submit(self._run, call)
        self._calls.append(future)
        future.add_done_callback(lambda _: self._wake.wake())

    def _run(self, call: Callable[[], _T]) -> _T:
        self._begun = time.monotonic()
        return call()

    def done(self) -> bool:
        """Say whether there is an end to be taken."""
        return bool(self._calls) and self._calls[0].done()

    def result(self) -> _T:
        """Wait for the first call's end and give what it gave, or raise what it raised."""
        if not self._calls:
            raise RuntimeError("no call was started")
        return self._calls.popleft().result()

    def cancel_queued(self) -> bool:
        """Take back the call that waits; False where there is none, or it has begun."""
        if len(self._calls) < _MOST or not self._calls[-1].cancel():
            return False
        self._calls.pop()
        return True

    def drain(self) -> None:
        """Forget what woke the poll; to be called before `done` is asked."""
        self._wake.drain()

    def wait(self, seconds: float) -> bool:
        """Wait for the first call, if any; False where it takes longer."""
        return not self._calls or not wait([self._calls[0]], seconds).not_done

    def close(self) -> None:
        """Wait for what was started, if anything, and end the thread."""
        self._pool.shutdown()
        self._wake.close()
