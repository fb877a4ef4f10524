"""How many files and connections this process has open, and when that is too many.

libzmq takes every connection, known key or not, and gives it 10 s to say who it is. Whoever opens
enough of them takes the descriptors that the hub needs for its own files.
"""

import errno
import resource
from pathlib import Path

__all__ = ["OUT_OF_DESCRIPTORS", "DescriptorWatch"]

OUT_OF_DESCRIPTORS = (errno.EMFILE, errno.ENFILE)
_OPEN = Path("/proc/self/fd")
_WANTED = 65_536
_RESERVE = 128


class DescriptorWatch:
    """Has the system give this process as many as it may have."""

    def __init__(self) -> None:
        soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
        wanted = _WANTED if hard == resource.RLIM_INFINITY else min(_WANTED, hard)
        if soft != resource.RLIM_INFINITY and soft < wanted:
            resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, hard))

    def beyond(self) -> int:
        """Give the number of descriptors in use where too few are left, else 0."""
        limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
        try:
            used = sum(1 for _ in _OPEN.iterdir())
        except OSError as error:
            if error.errno not in OUT_OF_DESCRIPTORS:
                raise
            used = limit
        return used if limit != resource.RLIM_INFINITY and used > limit - _RESERVE else 0
