"""Ctrl-C, SIGTERM and SIGHUP end a command without a word, whenever they come.

A `KeyboardInterrupt` is raised between any two steps of Python. In the middle of an import, C code
turns it into an error of its own; in a callback or a finaliser it is printed and lost; before
`main` and after it nobody catches it. So a signal ends the process at once while there is nothing
to clean up, and is raised otherwise, after the import that is under way.

This module is imported before all else and imports next to nothing: the time until its handlers
are there is time in which a signal leaves a traceback.
"""

import os
import sys

TYPE_CHECKING = False
if TYPE_CHECKING:
    import signal as _signal
    from types import FrameType, TracebackType
    from typing import NoReturn, Self
else:
    import _signal  # `signal` makes enums of all names first, which takes milliseconds

__all__ = ["Interruption", "end_at_once", "end_quietly", "interrupted"]

_SIGNALS = (_signal.SIGINT, _signal.SIGTERM, _signal.SIGHUP)
_AGAIN_S = 0.01
"""Time after which a signal that came in an import is tried again, seconds."""
_IMPORTING = "<frozen importlib._bootstrap>"
"""File name of the frames that import something."""

_raising = 0
"""Depth of the blocks in which a signal is raised."""
_received = 0
"""The last signal, 0 before."""
_pending = False
"""Whether it is still to be raised."""


def end_quietly() -> None:
    """Let these signals end this process; for the very first line of a command.

    One that is ignored stays so, as SIGHUP after `nohup` and SIGINT in a script's background.
    """
    for number in _SIGNALS:
        if _signal.getsignal(number) is not _signal.SIG_IGN:
            _signal.signal(number, _handle)
    sys.unraisablehook = _unraisable


def interrupted() -> int:
    """Give the exit status that is due to a signal, 128 and its number; 0 where none came."""
    return _received and 128 + _received


class Interruption:
    """Inside the `with` block signals are raised: KeyboardInterrupt, or SystemExit with 128 + n.

    In a thread other than the main one, it does nothing. Where `end_quietly` was not called, as in
    a program that calls a command's `main`, the handlers are as before at the end.
    """

    def __enter__(self) -> "Self":
        global _raising, _received
        self._before: list[tuple[int, _signal._HANDLER]] = []
        self._hook = sys.unraisablehook
        if not _raising:
            _received = 0
        _raising += 1
        try:
            for number in _SIGNALS:
                before = _signal.getsignal(number)
                if before is not _handle and before is not _signal.SIG_IGN:
                    _signal.signal(number, _handle)
                    self._before.append((number, before))
        except ValueError:  # not the main thread
            pass
        else:
            sys.unraisablehook = _unraisable
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        trace: "TracebackType | None",
    ) -> None:
        global _pending, _raising
        _raising -= 1
        for number, before in self._before:
            _signal.signal(number, before)
            sys.unraisablehook = self._hook
        if _pending and not _raising:
            _pending = False
            _signal.setitimer(_signal.ITIMER_REAL, 0.0)
            if kind is None:
                _raise(_received)


def end_at_once() -> None:
    """Let the system end this process at these signals, for the time in which Python unloads."""
    for number in _SIGNALS:
        if _signal.getsignal(number) is not _signal.SIG_IGN:
            _signal.signal(number, _signal.SIG_DFL)


def _handle(number: int, frame: "FrameType | None") -> None:
    global _received
    _received = number
    if not _raising:
        os._exit(128 + number)
    if _imports(frame):
        _try_again()
    else:
        _raise(number)


def _raise(number: int) -> "NoReturn":
    if number == _signal.SIGINT:
        raise KeyboardInterrupt
    raise SystemExit(128 + number)


def _imports(frame: "FrameType | None") -> bool:
    while frame is not None:
        if frame.f_code.co_filename == _IMPORTING:
            return True
        frame = frame.f_back
    return False


def _try_again() -> None:
    global _pending
    _pending = True
    _signal.signal(_signal.SIGALRM, _again)
    _signal.setitimer(_signal.ITIMER_REAL, _AGAIN_S)


def _again(*_: object) -> None:
    global _pending
    _pending = False
    # Sent anew: meanwhile the signal may have got another handler.
    _signal.raise_signal(_received)


def _unraisable(lost: "sys.UnraisableHookArgs") -> None:
    if not _received:
        sys.__unraisablehook__(lost)
    elif isinstance(lost.exc_value, KeyboardInterrupt | SystemExit):
        _try_again()
    # Else it comes of the signal: what was half made cannot be unmade.
