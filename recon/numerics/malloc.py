"""Memory that one frame frees is kept for the next.

glibc gives freed memory back to the kernel at once where a block was large or at the heap's end.
A frame needs the same few tens of megabytes as the one before; fetched anew, page by page, they
cost as much time as a fifth of the computation.
"""

import ctypes
from functools import cache

__all__ = ["keep_freed_memory"]

# mallopt(3): from what size a block is mapped by itself, and how much free memory the heap keeps.
_M_TRIM_THRESHOLD = -1
_M_MMAP_THRESHOLD = -3
# glibc takes no larger one for blocks.
_LARGEST_BLOCK = 32 * 1024**2
_KEPT = 64 * 1024**2


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
