"""A log behind a pipe of one page, whose reader can be told to stop reading."""

import fcntl
import os
import select
import threading
from pathlib import Path

__all__ = ["LogPipe"]

_PIPE_BYTES = 4096
"""The smallest pipe that Linux has: a few lines fill it."""
_LOOK_MS = 50


class LogPipe:
    """Copies what is written to `path`, a pipe, into the file `log`, while it is not stalled."""

    def __init__(self, path: Path, log: Path) -> None:
        self.path = path
        self.log = log
        self._flowing = threading.Event()
        self._flowing.set()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._copy, daemon=True)
        os.mkfifo(path, 0o600)
        # A writer of its own: without one, a hub that ends would be the end of the pipe.
        self._pipe = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)

    def open(self) -> None:
        """Begin to copy."""
        self._thread.start()

    def close(self) -> None:
        """Copy what is left and end; harmless when repeated, or before `open`."""
        self._over.set()
        self.flow()
        if self._thread.is_alive():
            self._thread.join()
            os.close(self._pipe)

    def stall(self) -> None:
        """Read nothing from now on."""
        self._flowing.clear()

    def flow(self) -> None:
        """Read again."""
        self._flowing.set()

    def _copy(self) -> None:
        poll = select.poll()
        poll.register(self._pipe, select.POLLIN)
        with self.log.open("ab", buffering=0) as log:
            while True:
                self._flowing.wait()
                if poll.poll(_LOOK_MS):
                    log.write(os.read(self._pipe, _PIPE_BYTES))
                elif self._over.is_set():
                    return
