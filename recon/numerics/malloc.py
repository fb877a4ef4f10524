"""What the C library's heap does with memory that is freed: kept for the next frame, or shared.

glibc returns freed memory to the kernel where a block was large or at the heap's end. Every frame
needs the same few tens of megabytes: fetched anew, page by page, they cost a fifth of its time.
"""

import ctypes
from functools import cache

__all__ = ["keep_freed_memory", "share_heaps"]

_M_TRIM_THRESHOLD = -1
"""mallopt(3): how much free memory at its end the heap keeps."""
_M_MMAP_THRESHOLD = -3
"""mallopt(3): from what size on a block is mapped by itself."""
_M_ARENA_MAX = -8
"""mallopt(3): how many heaps there may be; by default eight for each core."""
_HEAPS = 2
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
    return _set(_M_MMAP_THRESHOLD, _LARGEST_BLOCK) and _set(_M_TRIM_THRESHOLD, _KEPT)


@cache
def share_heaps() -> bool:
    """Ask the C library for two heaps at most; say whether it does.

    For the whole process: one whose threads come and go, as a driver's do each time a sensor is
    opened, calls it at its start. Else each new thread begins a heap of its own, in which the
    frames of the one before, 20 MB, are not used again. Without glibc nothing is changed.
    """
    return _set(_M_ARENA_MAX, _HEAPS)


def _set(option: int, value: int) -> bool:
    try:
        return bool(ctypes.CDLL(None).mallopt(option, value))
    except (AttributeError, OSError):
        return False
