"""A descriptor that another thread or a signal makes readable, so that a poll returns."""

import os
from contextlib import suppress

from denseface.service.runtime.closing import Closing

__all__ = ["WakePipe"]


class WakePipe(Closing):
    """Readable from `wake` to `drain`.

    Attributes
    ----------
    writer : descriptor for `signal.set_wakeup_fd`; never blocks
    """

    def __init__(self) -> None:
        self._reader, self.writer = os.pipe2(os.O_NONBLOCK | os.O_CLOEXEC)

    def fileno(self) -> int:
        """Give the descriptor to poll for reading."""
        return self._reader

    def wake(self) -> None:
        """Make the descriptor readable; for any thread."""
        with suppress(BlockingIOError):  # full, so it is readable
            os.write(self.writer, b"\0")

    def drain(self) -> None:
        """Make it unreadable again."""
        with suppress(BlockingIOError):
            os.read(self._reader, 2**16)

    def close(self) -> None:
        """Close both ends."""
        os.close(self._reader)
        os.close(self.writer)
