"""Writing past the page cache.

Frames and faces are sent from memory and hardly ever read from their files, while allocating and
filling their 2,000 pages of cache takes the kernel as long as all else that the hub does for them.
"""

import errno
import fcntl
import mmap
import os
import threading
from collections.abc import Sequence

_BLOCK = 4096
"""Alignment of memory, offset and size, bytes; a multiple of every disk's."""
_MIN_BYTES = 2**20
"""Smaller files are as quick through the cache."""
_UNSUPPORTED = (errno.EINVAL, errno.EOPNOTSUPP)
"""Errors of a file system without O_DIRECT."""


class _Buffer(threading.local):
    """Page-aligned memory, one for each thread, used again for the next file."""

    def __init__(self) -> None:
        self._memory = mmap.mmap(-1, _MIN_BYTES)

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
    """Write all of a new file; False where it is small or the file system cannot.

    Raises OSError as from the system, where the disk is full or fails.
    """
    size = sum(map(len, chunks))
    if size < _MIN_BYTES:
        return False
    flags = fcntl.fcntl(descriptor, fcntl.F_GETFL)
    try:
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags | os.O_DIRECT)
        left = _buffer.filled(chunks, -(-size // _BLOCK) * _BLOCK)
        while left:
            left = left[os.write(descriptor, left):]
    except OSError as error:
        if error.errno not in _UNSUPPORTED:
            raise
        fcntl.fcntl(descriptor, fcntl.F_SETFL, flags)
        os.lseek(descriptor, 0, os.SEEK_SET)
        os.ftruncate(descriptor, 0)
        return False
    fcntl.fcntl(descriptor, fcntl.F_SETFL, flags)
    os.ftruncate(descriptor, size)
    return True
