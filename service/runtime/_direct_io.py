"""Writing past the page cache.

Frames and faces go out from memory and are hardly ever read from their files. To find and fill the
2,000 pages of cache for both takes the kernel two to eight milliseconds, as much as all else that
the hub does.
"""

import errno
import fcntl
import mmap
import os
import threading
from collections.abc import Sequence

__all__ = ["write_direct"]

_BLOCK = 4096
"""Of memory, file and size: no disk has larger ones."""
_LEAST = 2**20
"""Bytes; less is as quick through the cache."""
_REFUSED = (errno.EINVAL, errno.EOPNOTSUPP)


class _Buffer(threading.local):
    """Memory that begins at a page, kept for the next file of the same thread."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, _LEAST)

    def filled(self, chunks: Sequence[bytes | memoryview], size: int) -> memoryview:
        if len(self._memory) < size:
            self._memory = mmap.mmap(-1, size)
        view, at = memoryview(self._memory), 0
        for chunk in chunks:
            view[at:at + len(chunk)] = chunk
            at += len(chunk)
        return view[:size]


_buffer = _Buffer()


def write_direct(descriptor: int, chunks: Sequence[bytes | memoryview]) -> bool:
    """Write all of a new file; False where it is small or this file system has no such way.

    Raises
    ------
    OSError
        As from the system, where there is no room or the disk fails.
    """
    size = sum(map(len, chunks))
    if size < _LEAST:
        return False
    flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_DIRECT)
        left = _buffer.filled(chunks, -(-size // _BLOCK) * _BLOCK)
        while left:
            left = left[os.write(descriptor, left):]
    except OSError as error:
        if error.errno not in _REFUSED:
            raise
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.ftruncate(descriptor, 0)
        return False
    fcntl.fcntl(descriptor, fcntl.F_SETFL, flags)
    os.ftruncate(descriptor, size)
    return True
