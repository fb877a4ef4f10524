"""How much memory this process uses, and when that is too much.

libzmq keeps a message of many parts until the last has come, without a limit of its own: whoever
has a key could fill the memory with one that never ends. The only cure is to cut the connection.
"""

import ctypes
import os

__all__ = ["MemoryWatch"]

_PAGE = os.sysconf("SC_PAGE_SIZE")
_STATM = "/proc/self/statm"
_GROWTH = 1.25


class MemoryWatch:
    """Says when the memory in use goes beyond a limit, once for each time that it does."""

    def __init__(self, limit: int) -> None:
        self._statm = os.open(_STATM, os.O_RDONLY)  # kept: one may not be had later
        self._limit = self._ceiling = limit
        self._cut = False

    def beyond(self) -> int:
        """Give the bytes in use where they are too many, else 0."""
        used = self._used()
        if used > self._limit:
            # What was freed stays with the process, and libzmq frees some time after a cut.
            self._trim()
            used = self._used()
        if self._cut:
            # What is left may be in use for long: only what grows from here is new.
            self._cut = False
            self._ceiling = max(self._limit, int(used * _GROWTH))
        elif used < self._limit:
            self._ceiling = self._limit
        if used <= self._ceiling:
            return 0
        self._cut = True
        return used

    def close(self) -> None:
        """Watch no more."""
        os.close(self._statm)

    def _used(self) -> int:
        return int(os.pread(self._statm, 256, 0).split()[1]) * _PAGE

    @staticmethod
    def _trim() -> None:
        """Give freed memory back to the system, where the C library can."""
        trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
        if trim is not None:
            trim(0)
