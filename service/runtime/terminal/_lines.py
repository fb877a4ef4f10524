"""Whole lines, on stdout or stderr.

Whoever reads a line believes its colours and its line breaks, and a terminal obeys its escape
sequences: names, reasons and file names may hold any of them.
"""

import os
import select
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from types import TracebackType
from typing import TextIO

__all__ = [
    "ask", "can_ask", "complain", "complain_of", "discard_unless_flushed",
    "fill_standard_descriptors", "flush_stdout", "printable", "reader_left", "say", "step_aside_by",
    "stepping_aside", "suggest",
]

_aside: Callable[[], AbstractContextManager[object]] = nullcontext
"""Clears the line that moves on the terminal, if any, while another is printed."""


def step_aside_by(aside: Callable[[], AbstractContextManager[object]]) -> None:
    """Print lines inside the `with` block that this gives, from now on."""
    global _aside
    _aside = aside


@contextmanager
def stepping_aside(aside: Callable[[], AbstractContextManager[object]]) -> Iterator[None]:
    """Within the block, print lines inside the `with` block that `aside` gives, too."""
    global _aside
    before = _aside

    @contextmanager
    def both() -> Iterator[None]:
        with before(), aside():
            yield

    _aside = both
    try:
        yield
    finally:
        _aside = before


def printable(text: str) -> str:
    """Escape line breaks, control characters and what changes the order of reading."""
    if text.isprintable():
        return text
    return "".join(one if one.isprintable() else ascii(one)[1:-1] for one in text)


def say(*lines: str, flush: bool = False) -> None:
    """Print lines on stdout, escaped; OSError, which names stdout, where that fails."""
    with _aside(), _named():
        for line in lines:
            print(printable(line), flush=flush)


def flush_stdout() -> None:
    """Write what is still to be written on stdout, where there is one; OSError as of `say`."""
    if sys.stdout is not None:
        with _named():
            sys.stdout.flush()


@contextmanager
def _named() -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, "stdout") from error


def complain(line: str) -> None:
    """Print one line on stderr, escaped; it is lost where that cannot be written."""
    if sys.stderr is None:  # `print` would take stdout
        return
    with _aside(), suppress(OSError, ValueError):
        print(printable(line), file=sys.stderr)
    discard_unless_flushed(sys.stderr)


def suggest(command: str, why: str = "") -> None:
    """Say on stderr what people type next; only to somebody who sees what the command said."""
    try:
        seen = all(one is not None and one.isatty() for one in (sys.stdout, sys.stderr))
    except ValueError:  # closed
        return
    if seen:
        complain(f"next: {command}{'    ' if why else ''}{why}")


def can_ask() -> bool:
    """Say whether somebody sits at a terminal and can be asked."""
    try:
        return sys.stdin is not None and sys.stderr is not None and sys.stdin.isatty()
    except ValueError:  # closed
        return False


def ask(question: str) -> str | None:
    """Ask on stderr, as stdout may lead elsewhere; None at the end of the input, as by Ctrl-D."""
    with _aside():
        try:
            sys.stderr.write(f"{printable(question)} ")
            sys.stderr.flush()
            if answer := sys.stdin.readline():
                return answer.strip()
            sys.stderr.write("\n")
        except (OSError, ValueError):
            discard_unless_flushed(sys.stderr)
    return None


def complain_of(
    kind: type[BaseException], error: BaseException, trace: TracebackType | None
) -> None:
    """Print a traceback on stderr as `complain` does; for `sys.excepthook`."""
    import traceback

    for text in traceback.format_exception(kind, error, trace):
        for line in text.rstrip("\n").split("\n"):
            complain(line)


def discard_unless_flushed(stream: TextIO | None) -> None:
    """Flush a stream; let it lead nowhere where that fails.

    Python would try once more at exit, complain, and end with a status of its own.
    """
    if stream is None:
        return
    try:
        stream.flush()
    except (OSError, ValueError):
        with suppress(OSError, ValueError):
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, stream.fileno())
            os.close(null)


def reader_left(stream: TextIO | None) -> bool:
    """Say whether a stream is a pipe or a connection that nobody reads any more."""
    if stream is None:
        return False
    try:
        poll = select.poll()
        poll.register(stream.fileno(), select.POLLOUT)
        return any(events & (select.POLLERR | select.POLLHUP) for _, events in poll.poll(0))
    except (OSError, ValueError):
        return False


def fill_standard_descriptors() -> None:
    """Open what of stdin, stdout and stderr is closed, so that no other file gets its number.

    What a library prints would go into that file. Writing fails, as it did before.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            with suppress(OSError):  # the lowest free number is this one
                os.set_inheritable(os.open(os.devnull, os.O_RDONLY), True)
