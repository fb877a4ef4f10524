"""How many pages are open, and when the last one was closed for good."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager

__all__ = ["Pages"]

_GONE_S = 2.0
"""A page that is loaded anew is gone for less, seconds."""


class Pages:
    """Counts open pages, in one event loop.

    Parameters
    ----------
    gone_s : how long none must be open until `closed` is done, seconds
    """

    def __init__(self, gone_s: float = _GONE_S) -> None:
        self._gone_s = gone_s
        self._count = 0
        self._due: asyncio.TimerHandle | None = None
        self.closed: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        """Done when there was a page and there is none any more."""

    @contextmanager
    def open(self) -> Iterator[None]:
        """Count a page, while it is open."""
        self._count += 1
        if self._due:
            self._due.cancel()
        try:
            yield
        finally:
            self._count -= 1
            if not self._count:
                self._due = asyncio.get_running_loop().call_later(self._gone_s, self._close)

    def _close(self) -> None:
        if not self.closed.done():
            self.closed.set_result(None)
