"""A second engine: a plain pool of processes, the peer that Dask is held against."""

from collections.abc import Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from itertools import count
from multiprocessing import get_context
from typing import Any

from denseface.service.tools.batch.engines.engine import Done, EngineError, Work


class PoolEngine:
    """Processes of the standard library; a pool that a task broke is made anew."""

    def __init__(self, work: Work, workers: int) -> None:
        self._work, self.width = work, workers
        self._numbers = count()
        self._futures: dict[Future[dict[str, Any]], int] = {}
        self._pool = self._new()

    def _new(self) -> ProcessPoolExecutor:
        return ProcessPoolExecutor(self.width, mp_context=get_context("spawn"))

    def submit(self, task: dict[str, Any], worker: str = "") -> int:  # noqa: ARG002
        handle = next(self._numbers)
        try:
            future = self._pool.submit(self._work, task)
        except BrokenProcessPool:
            self._pool = self._new()
            future = self._pool.submit(self._work, task)
        self._futures[future] = handle
        return handle

    def completed(self) -> Iterator[Done]:
        while self._futures:
            for future in wait(self._futures, return_when=FIRST_COMPLETED).done:
                handle = self._futures.pop(future)
                error = future.exception()
                if error is not None and not isinstance(error, BrokenProcessPool):
                    raise EngineError(f"a worker cannot do what it is asked: {error}")
                yield Done(handle, None if error else future.result())

    def close(self) -> None:
        self._futures.clear()
        self._pool.shutdown(wait=True, cancel_futures=True)
