"""What takes long says so, on stderr alone."""

import io
import os
import pty
import signal
import sys
import threading
from pathlib import Path
from types import SimpleNamespace

import pytest

from denseface.service.runtime.terminal import _lines, complain, progress, say
from denseface.service.runtime.terminal.progress import Progress, duration
from tests.waiting import until


class Clock:
    now_s = 0.0

    def __call__(self):
        return self.now_s


class Terminal(io.StringIO):
    """Remembers its lines as they look after each carriage return."""

    def isatty(self):
        return True

    def screen(self):
        """Give what can be read in the end."""
        lines = [[]]
        column = 0
        for one in self.getvalue():
            if one == "\n":
                lines.append([])
            if one in "\r\n":
                column = 0
                continue
            lines[-1][column:column + 1] = [one]
            column += 1
        return ["".join(line).rstrip() for line in lines]


def stderr_is(monkeypatch, stream):
    """Give it the modules; pytest sets `sys.stderr` itself before the test begins."""
    for module in (progress, _lines):
        monkeypatch.setattr(module, "sys", SimpleNamespace(stderr=stream, stdout=sys.stdout))
    return stream


@pytest.fixture
def terminal(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(progress, "_MOVE_AFTER_S", 0.0)
    monkeypatch.setattr(progress, "_REFRESH_S", 0.001)
    yield stderr_is(monkeypatch, Terminal())
    assert not any(one.name == "progress" for one in threading.enumerate())


def test_parts_rate_and_time_left():
    line = Progress("compiling", total=40, unit="kernels", clock=(clock := Clock()))
    assert line.text() == "compiling: 0 of 40 kernels (0 %)"
    line.advance(10)
    clock.now_s = 5.0
    assert line.text() == "compiling: 10 of 40 kernels (25 %), 2.0 a second, about 15 s left"
    line.show("frame 3")
    clock.now_s = 40.0
    assert line.text().endswith("(25 %), 4 s each, about 2 min 0 s left, frame 3")
    line.advance(30)
    assert "40 of 40 kernels (100 %)" in line.text()
    assert "left" not in line.text()


def test_what_is_only_waited_for_says_how_long():
    line = Progress("waiting for the hub", clock=(clock := Clock()))
    clock.now_s = 75.0
    assert line.text() == "waiting for the hub: 1 min 15 s"
    line.show("no answer")
    assert line.text() == "waiting for the hub: no answer"


@pytest.mark.parametrize(("seconds", "said"), [
    (0.4, "0 s"), (59.4, "59 s"), (59.6, "1 min 0 s"), (3725, "1 h 2 min"), (-3, "0 s")])
def test_durations(seconds, said):
    assert duration(seconds) == said


def test_a_terminal_has_a_line_that_moves_and_nothing_in_the_end(terminal):
    with Progress("counting", total=2) as line:
        until(lambda: "0 of 2" in terminal.getvalue())
        line.advance()
        until(lambda: "1 of 2" in terminal.getvalue())
    assert terminal.screen() == [""]
    assert "\x1b" not in terminal.getvalue()


def test_ctrl_c_leaves_a_clean_line(terminal):
    def count():
        with Progress("counting"):
            until(lambda: "counting" in terminal.getvalue())
            signal.raise_signal(signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        count()
    assert terminal.screen() == [""]


def test_other_lines_are_whole_while_it_moves(terminal, capsys):
    with Progress("counting", total=900) as line:
        until(lambda: "counting" in terminal.getvalue())
        complain("warning: doubt")
        say("done")
        seen = len(terminal.getvalue())
        line.advance(512)
        until(lambda: "512" in terminal.getvalue()[seen:])
    assert terminal.screen() == ["warning: doubt", ""]
    assert capsys.readouterr().out == "done\n"


def test_one_within_another_has_the_line_meanwhile(terminal):
    with Progress("outer"):
        until(lambda: "outer" in terminal.getvalue())
        with Progress("inner"):
            until(lambda: "inner" in terminal.getvalue())
        seen = len(terminal.getvalue())
        until(lambda: "outer" in terminal.getvalue()[seen:])
    assert terminal.screen() == [""]


def test_a_line_is_no_wider_than_the_terminal_and_does_nothing_to_it(terminal):
    with Progress("x\x1b[2J\n" + "日" * 200):
        until(lambda: "日" in terminal.getvalue())
    first = terminal.getvalue().split("\r")[1]
    assert first.startswith(r"x\x1b[2J\n日")
    assert len(first.strip()) + first.count("日") <= 79
    assert terminal.screen() == [""]


def test_of_a_long_line_what_moves_is_seen(terminal):
    with Progress("reconstructing " + "a/" * 50 + "take.oni", total=9, unit="frames"):
        until(lambda: "reconstructing a" in terminal.getvalue())
        assert terminal.screen()[-1].rstrip().endswith("...: 0 of 9 frames (0 %)")
    assert terminal.screen() == [""]


@pytest.mark.parametrize("term", ["dumb", "", None])
def test_a_terminal_that_cannot_write_over_gets_one_plain_line(terminal, monkeypatch, term):
    if term is None:
        monkeypatch.delenv("TERM")
    else:
        monkeypatch.setenv("TERM", term)
    with Progress("waiting", plain_after_s=0.0) as line:
        line.show("for a hub")
        until(lambda: terminal.getvalue())
        until(lambda: not line._thread.is_alive())
    assert terminal.getvalue() in {"waiting: for a hub ...\n", "waiting ...\n"}


def test_a_pipe_gets_one_plain_line(capsys):
    with Progress("compiling", total=9, unit="kernels", plain_after_s=0.0) as line:
        until(lambda: not line._thread.is_alive())
        line.advance()
    assert capsys.readouterr() == ("", "compiling: 9 kernels ...\n")


def test_what_is_done_soon_is_not_said(capsys):
    with Progress("compiling"):
        pass
    assert capsys.readouterr() == ("", "")


def _closed():
    stream = io.StringIO()
    stream.close()
    return stream


@pytest.mark.parametrize("stream", ["none", "closed", "full"])
def test_a_stderr_that_is_closed_or_full_is_no_reason_to_fail(monkeypatch, stream):
    with Path("/dev/full").open("w") as full:
        if stream == "closed":
            full.close()
        stderr_is(monkeypatch, None if stream == "none" else full)
        with Progress("waiting", plain_after_s=0.0) as line:
            until(lambda: not line._thread.is_alive())
            complain("lost")


def test_a_terminal_that_goes_away_is_no_reason_to_fail(terminal, monkeypatch):
    ours, theirs = pty.openpty()
    with os.fdopen(theirs, "w") as gone:
        stderr_is(monkeypatch, gone)
        with Progress("waiting", total=9) as line:
            until(lambda: line._width)
            os.close(ours)
            line.advance(5)
            complain("lost")
    assert terminal.getvalue() == ""


def test_parts_of_many_threads_are_all_counted():
    line = Progress("many")
    threads = [threading.Thread(target=lambda: [line.advance() for _ in range(500)])
               for _ in range(4)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert "2000" in line.text()


def test_a_forked_child_can_print(terminal):
    with Progress("parent"):
        until(lambda: "parent" in terminal.getvalue())
        with progress._lock:
            if not (child := os.fork()):
                try:
                    complain("child")
                    with Progress("child"):
                        pass
                finally:
                    os._exit(0 if not progress._running else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
