"""Memory and file descriptors of this process, and when it uses too many.

libzmq sets no limit of its own to either. It keeps a message of many parts until the last has
come, so whoever has a key could fill the memory with one that never ends. It takes every
connection, with a known key or without, and gives it 10 s to authenticate: enough of them take the
descriptors that the hub needs for its files. The only cure is to cut connections.
"""

import ctypes
import errno
import os
import resource
from pathlib import Path

__all__ = ["OUT_OF_DESCRIPTORS", "DescriptorWatch", "MemoryWatch"]

OUT_OF_DESCRIPTORS = (errno.EMFILE, errno.ENFILE)
"""Error numbers where this process, or the machine, has no descriptor left."""

_OPEN_DESCRIPTORS = Path("/proc/self/fd")
"""One entry for each open descriptor; see proc(5)."""
_WANTED_DESCRIPTORS = 65_536
"""Limit that is asked of the system."""
_SPARE_DESCRIPTORS = 128
"""Descriptors that are to stay free for the hub's own files."""

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

    def over_limit(self) -> int:
        """Give the bytes in use where they exceed the limit, else 0."""
        used = self._used()
        if used > self._limit:
            # Freed memory stays with the process, and libzmq frees some time after a cut.
            if trim := getattr(ctypes.CDLL(None), "malloc_trim", None):
                trim(0)
            used = self._used()
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


class DescriptorWatch:
    """Raises the limit of this process as far as allowed, and tells when it is nearly reached."""

    def __init__(self) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = _WANTED_DESCRIPTORS
        if hard != resource.RLIM_INFINITY:
            wanted = min(wanted, hard)
        if soft != resource.RLIM_INFINITY and soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))

    def over_limit(self) -> int:
        """Give the descriptors in use where too few are left, else 0."""
        limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        try:
            used = sum(1 for _ in _OPEN_DESCRIPTORS.iterdir())
        except OSError as error:
            if error.errno not in OUT_OF_DESCRIPTORS:
                raise
            used = limit
        return used if limit != resource.RLIM_INFINITY and used > limit - _SPARE_DESCRIPTORS else 0
