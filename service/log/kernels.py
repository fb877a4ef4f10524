"""What is said while kernels are compiled: by a line that moves, by two lines, or by events.

recon logs it, with a `Progress` of `recon.numerics.compilation` as `record.progress`, which is not
imported here: most commands need no kernels, and it brings numba along.
"""

import logging
import time
from typing import Any

from denseface.service.runtime.terminal import complain
from denseface.service.runtime.terminal.progress import Progress

__all__ = ["KernelEvents", "KernelLines", "tell_of_kernels"]

_LOGGER = "denseface.kernels"
"""As in recon."""
_EVENT_S = 10.0
"""Time between two events that say how far it is, seconds."""
_WHAT = {"compiling": "compiling, once on this machine",
         "waiting": "waiting for another process that compiles"}


def tell_of_kernels(handler: logging.Handler) -> None:
    """Have this handler, and no other, say what is compiled."""
    logger = logging.getLogger(_LOGGER)
    for other in logger.handlers[:]:
        logger.removeHandler(other)
        other.close()
    logger.addHandler(handler)
    logger.setLevel(logging.INFO)
    logger.propagate = False


class KernelLines(logging.Handler):
    """Lines for a command: how far it is, and at the end how long it took."""

    def __init__(self) -> None:
        super().__init__()
        self._line: Progress | None = None
        self._state = ""
        self._done = 0

    def emit(self, record: logging.LogRecord) -> None:
        """Show a record of recon's."""
        progress: Any = record.progress  # type: ignore[attr-defined]
        if progress.state != self._state:
            self.close_line()
            if progress.state in _WHAT:
                self._line = Progress(_WHAT[progress.state], total=progress.total, unit="kernels",
                                      plain_after_s=0.0)
                self._line.__enter__()
                self._state = progress.state
            else:
                complain(record.getMessage())
        if self._line is not None:
            self._line.total = progress.total
            self._line.advance(progress.done - self._done)
            self._done = progress.done

    def close_line(self) -> None:
        """Take the line away."""
        if self._line is not None:
            self._line.__exit__()
        self._line, self._state, self._done = None, "", 0

    def close(self) -> None:
        """Take the line away, for good."""
        self.close_line()
        super().close()


class KernelEvents(logging.Handler):
    """Events for the log of a process that runs on: when it begins, every ten seconds, the end."""

    def __init__(self) -> None:
        super().__init__()
        self._due = 0.0

    def emit(self, record: logging.LogRecord) -> None:
        """Log a record of recon's, unless another was logged just now."""
        progress: Any = record.progress  # type: ignore[attr-defined]
        now = time.monotonic()
        if record.levelno < logging.WARNING and (
                now < self._due or progress.state == "waiting"):  # the other says it
            return
        self._due = now + _EVENT_S
        import structlog  # which a command that only says lines need not load

        log = structlog.get_logger("kernels")
        if progress.not_kept:
            log.warning("compiled kernels are kept nowhere: each start compiles them again",
                        reason=progress.not_kept,
                        set="NUMBA_CACHE_DIR=a folder that this user alone can write")
        log.info(f"kernels {progress.state}" if progress.state != "waiting" else
                 "another process compiles the kernels", done=progress.done, of=progress.total,
                 seconds=round(progress.seconds, 1))
