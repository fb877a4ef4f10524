"""Memory that one frame frees is kept for the next.

glibc returns freed memory to the kernel where a block was large or at the heap's end. Every frame
needs the same few tens of megabytes: fetched anew, page by page, they cost a fifth of its time.
"""

import ctypes
from functools import cache

__all__ = ["keep_freed_memory"]

_M_TRIM_THRESHOLD = -1
"""mallopt(3): how much free memory at its end the heap keeps."""
_M_MMAP_THRESHOLD = -3
"""mallopt(3): from what size on a block is mapped by itself."""
_LARGEST_BLOCK = 32 * 1024**2
"""Bytes; glibc takes no larger threshold."""
_KEPT = 64 * 1024**2
"""Bytes."""


@cache
def keep_freed_memory() -> bool:
    """Ask the C library to keep what is freed, up to 64 MiB; say whether it does.

    For the whole process: a program that reconstructs many faces calls it once, others need not.
    Without glibc nothing is changed.
    """
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except (AttributeError, OSError):
        return False
    return bool(mallopt(_M_MMAP_THRESHOLD, _LARGEST_BLOCK)) and bool(
        mallopt(_M_TRIM_THRESHOLD, _KEPT))
