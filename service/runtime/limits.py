"""Memory of this process, and when it uses too much.

libzmq sets no limit of its own. It keeps a message of many parts until the last has come, so
whoever has a key could fill the memory with one that never ends. The only cure is to cut
connections.
"""

import ctypes
import errno
import os

__all__ = ["OUT_OF_DESCRIPTORS", "MemoryWatch"]

OUT_OF_DESCRIPTORS = (errno.EMFILE, errno.ENFILE)
"""Error numbers where this process, or the machine, has no descriptor left."""

_STATM = "/proc/self/statm"
"""Memory in use, in pages; see proc(5)."""
_PAGE_BYTES = os.sysconf("SC_PAGE_SIZE")
_GROWTH = 1.25
"""After connections were cut: growth of the memory in use that counts as new."""


class MemoryWatch:
    """Tells when the memory in use exceeds a limit, once each time.

    Parameters
    ----------
    limit : bytes
    """

    def __init__(self, limit: int) -> None:
        self._statm = os.open(_STATM, os.O_RDONLY)  # later there may be no descriptor
        self._limit = self._ceiling = limit
        self._cut = False
        self.cut_was_too_little = False
        """At the last look, the first after a cut, the memory in use exceeded the limit still."""

    def over_limit(self) -> int:
        """Give the bytes in use where they exceed the limit, else 0."""
        used = self._used()
        if used > self._limit:
            # Freed memory stays with the process, and libzmq frees some time after a cut.
            if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
                trim(0)
            used = self._used()
        self.cut_was_too_little = self._cut and used > self._limit
        if self._cut:
            # What is still in use after a cut may be for long: only growth beyond it counts.
            self._cut = False
            self._ceiling = max(self._limit, int(used * _GROWTH))
        elif used < self._limit:
            self._ceiling = self._limit
        if used <= self._ceiling:
            return 0
        self._cut = True
        return used

    def close(self) -> None:
        """Close the descriptor."""
        os.close(self._statm)

    def _used(self) -> int:
        return int(os.pread(self._statm, 256, 0).split()[1]) * _PAGE_BYTES
