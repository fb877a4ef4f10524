"""What is said of kernels that are compiled, in lines and in a log."""

import io
import logging
import sys
from dataclasses import replace

import pytest
import structlog

from denseface.recon.numerics.compilation.progress import LOGGER, Progress
from denseface.service.log import kernels
from denseface.service.log.kernels import KernelEvents, KernelLines, tell_of_kernels
from tests.waiting import until


@pytest.fixture
def report():
    """Report progress as recon does."""
    logger = logging.getLogger(LOGGER)

    def reported(*told):
        for one in told:
            level = logging.INFO if one in (SOME, LAST) else logging.WARNING
            logger.log(level, "%s", one, extra={"progress": one})

    yield reported
    for handler in logger.handlers[:]:
        logger.removeHandler(handler)
    logger.propagate = True


class Terminal(io.StringIO):
    def isatty(self):
        return True


FIRST, SOME, LAST = (Progress("compiling", done, 63) for done in (0, 12, 63))
END = Progress("compiled", 63, 63, 74.4)


def test_a_terminal_has_one_line_that_moves(report, monkeypatch):
    monkeypatch.setattr(sys, "stderr", Terminal())
    monkeypatch.setenv("TERM", "xterm")
    tell_of_kernels(KernelLines())
    report(FIRST, SOME)
    until(lambda: ": 12 of 63 kernels (19 %)" in sys.stderr.getvalue())
    report(LAST, END)
    assert sys.stderr.getvalue().endswith("kernels ready after 74 s\n")


def test_elsewhere_there_is_a_line_at_the_beginning_and_one_at_the_end(report, capsys):
    tell_of_kernels(KernelLines())
    report(Progress("waiting", 3, 63))
    text = ""

    def said():
        nonlocal text
        text += capsys.readouterr().err
        return text.count("\n")

    until(lambda: said() == 1)
    report(FIRST, SOME)
    until(lambda: said() == 2)
    report(LAST, END)
    said()
    assert text == ("waiting for another process that compiles: 63 kernels ...\n"
                    "compiling, once on this machine: 63 kernels ...\n"
                    "kernels ready after 74 s\n")


def test_a_log_tells_of_it_now_and_then(report, monkeypatch):
    tell_of_kernels(KernelEvents())
    with structlog.testing.capture_logs() as events:
        report(FIRST, SOME, LAST, END)
    assert [(one["event"], one["done"], one["of"]) for one in events] == [
        ("kernels compiling", 0, 63), ("kernels compiled", 63, 63)]
    monkeypatch.setattr(kernels, "_EVENT_S", 0.0)
    with structlog.testing.capture_logs() as events:
        report(FIRST, SOME, replace(END, not_kept="/nowhere: Read-only file system"))
    assert [one["event"] for one in events] == [
        "kernels compiling", "kernels compiling",
        "compiled kernels are kept nowhere: each start compiles them again", "kernels compiled"]
