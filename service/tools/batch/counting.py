"""How many sources there are, counted beside the work: who waits wants to know how much is left."""

import threading
from collections.abc import Callable, Iterator
from typing import Self

from denseface.service.tools.batch.parts import Part

__all__ = ["Counting"]


class Counting:
    """Walks through sources in a thread of its own, from the beginning of the `with` block.

    Parameters
    ----------
    sources : gives them, one after the other
    """

    def __init__(self, sources: Callable[[], Iterator[Part]]) -> None:
        self._sources = sources
        self._ended = threading.Event()
        self.all: int | None = None
        """How many there are; None until that is known."""

    def __enter__(self) -> Self:
        threading.Thread(target=self._count, name="counting sources", daemon=True).start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def _count(self) -> None:
        count = 0
        for _ in self._sources():
            if self._ended.is_set():
                return
            count += 1
        self.all = count
