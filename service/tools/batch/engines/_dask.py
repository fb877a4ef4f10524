"""Dask distributed as the engine: what it is asked, whatever cluster it has."""

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from itertools import count
from typing import Any

from distributed import Client, Future, KilledWorker, as_completed, get_worker

from denseface.errors import DensefaceError
from denseface.service.tools.batch.engines.engine import Done, EngineError, Work

__all__ = ["DaskEngine"]

_KEYS = "denseface-batch"
"""What tasks are called: one name and a number, or the scheduler would count each kind apart."""
_LOOK_S = 5.0
"""Time after which the number of workers is asked for again, seconds."""
_CLOSE_S = 5.0
"""Longest wait for the scheduler to hear that nothing more is wanted, seconds."""


class DaskEngine:
    """A cluster, by its client.

    Parameters
    ----------
    client : of the cluster; closed at the end
    work : what is called with each task
    close_cluster : closes what the client does not, and is told whether tasks may still run
    """

    def __init__(
        self, client: Client, work: Work, close_cluster: Callable[[bool], None] = lambda _: None
    ) -> None:
        self._client, self._work, self._close_cluster = client, work, close_cluster
        self._numbers = count()
        self._futures: dict[Future[Any], int] = {}
        self._ended = as_completed(loop=client.loop, with_results=True, raise_errors=False)
        self._width, self._looked_s = 0, 0.0
        self._closed = False

    @property
    def width(self) -> int:
        """How many workers there are: each makes one face at a time."""
        if not self._width or time.monotonic() - self._looked_s > _LOOK_S:
            with suppress(OSError, TimeoutError):
                self._width = len(self._client.nthreads())
            self._looked_s = time.monotonic()
        return max(1, self._width)

    def submit(self, task: dict[str, Any], worker: str = "") -> int:
        """Send a task; `Engine.submit`."""
        handle = next(self._numbers)
        where = {"workers": [worker], "allow_other_workers": True} if worker else {}
        try:
            future = self._client.submit(
                _call, self._work, task, key=(_KEYS, self._client.id, handle), pure=False, **where)
        except Exception as error:
            raise EngineError(f"a task cannot be sent: {_said(error)}") from error
        self._futures[future] = handle
        self._ended.add(future)
        return handle

    def completed(self) -> Iterator[Done]:
        """Give tasks as they end; `Engine.completed`."""
        while self._futures:
            future, result = next(self._ended)
            handle = self._futures.pop(future)
            status = future.status
            future.release()
            if status == "finished":
                answer, worker = result
                yield Done(handle, answer, worker)
                continue
            error = result[1] if isinstance(result, tuple) else result
            if not isinstance(error, KilledWorker):
                raise EngineError(_why(status, error))
            yield Done(handle, None)

    def close(self) -> None:
        """Give up what is not done; `Engine.close`."""
        if self._closed:
            return
        self._closed = True
        busy = bool(self._futures)
        try:
            if busy:
                with suppress(Exception):  # of a scheduler that is gone
                    self._client.cancel(list(self._futures), force=True)
            self._futures.clear()
        finally:
            try:
                self._close_cluster(busy)
            finally:
                with suppress(Exception):
                    self._client.close(timeout=_CLOSE_S)


def _call(work: Work, task: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """Do a task in a worker; also say which one that is."""
    return work(task), get_worker().address


def _why(status: str, error: object) -> str:
    if status in ("cancelled", "lost"):
        return "the connection to Dask's scheduler is lost"
    if isinstance(error, DensefaceError):
        return str(error)
    return f"a worker cannot do what it is asked: {_said(error)}"


def _said(error: object) -> str:
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
