"""SIGINT, SIGTERM and SIGHUP for a poll, and a process that ends with its parent."""

import ctypes
import os
import signal
from contextlib import ExitStack
from types import FrameType
from typing import Self

from denseface.service.runtime.wake_pipe import WakePipe

__all__ = ["PARENT_VARIABLE", "StopSignal", "die_with_parent"]

PARENT_VARIABLE = "DENSEFACE_PARENT"
"""Process id of the supervisor that started this process."""

_PR_SET_PDEATHSIG = 1
"""See prctl(2)."""
_STOPPING = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


class StopSignal(WakePipe):
    """Inside the `with` block, signals only set `received` and make this readable.

    Parameters
    ----------
    also : signals that only wake the poll, such as SIGCHLD
    """

    def __init__(self, *also: signal.Signals) -> None:
        super().__init__()
        self.received: signal.Signals | None = None
        self._handled = *_STOPPING, *also
        self._before = ExitStack()

    def __enter__(self) -> Self:
        self._before.callback(signal.set_wakeup_fd, signal.set_wakeup_fd(
            self.writer, warn_on_full_buffer=False))
        for number in self._handled:
            if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
                continue  # after `nohup`
            self._before.callback(signal.signal, number, signal.signal(number, self._note))
        return self

    def close(self) -> None:
        """Set the handlers back; also at the end of the `with` block."""
        self._before.close()
        super().close()

    def __bool__(self) -> bool:
        return self.received is not None

    @property
    def exit_status(self) -> int:
        """130 after Ctrl-C, else 0."""
        return 130 if self.received is signal.SIGINT else 0

    @property
    def reason(self) -> str:
        """What was received, in the words of whoever sent it; empty before."""
        return "Ctrl-C" if self.received is signal.SIGINT else getattr(self.received, "name", "")

    def _note(self, number: int, frame: FrameType | None) -> None:  # noqa: ARG002
        if number in _STOPPING and self.received is None:
            self.received = signal.Signals(number)


def die_with_parent() -> None:
    """Have the kernel send SIGTERM when the supervisor dies.

    Does nothing in a process that no supervisor started.
    """
    parent = os.environ.pop(PARENT_VARIABLE, "")
    if not parent:
        return
    ctypes.CDLL(None, use_errno=True).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM, 0, 0, 0)
    if str(os.getppid()) != parent:  # it died before prctl
        raise SystemExit(1)
