"""How far an archive is, on stderr alone."""

import os
import sys
import threading
from contextlib import suppress
from types import SimpleNamespace

import pytest

from denseface.service.runtime.terminal import _lines, complain, say
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.summary import progress
from denseface.service.tools.batch.summary.progress import BatchProgress, Rate
from tests.waiting import LIMIT_S, until

FACE = Row(source="a", frame=0, state="face")
NONE = Row(source="a", frame=1, state="no_face", why="nobody")
FAILED = Row(source="a", frame=2, state="failed", why="killed")


class Clock:
    now_s = 0.0

    def __call__(self):
        return self.now_s


def test_the_line_tells_done_rate_time_left_and_what_failed():
    line = BatchProgress(2000, before=500, clock=(clock := Clock()))
    assert line.text() == "500 of 2,000 frames (25 %), 0 s"
    for row in (FACE, FACE, NONE, FAILED):
        clock.now_s += 0.1
        line.add(row)
    assert line.text() == ("504 of 2,000 frames (25 %), 10.0 a second, about 2 min 30 s left, "
                           "1 without a face, 1 failed")
    clock.now_s = 40.0
    assert "10 s each" in line.text()


def test_without_a_total_there_is_no_time_left_until_it_is_known():
    line = BatchProgress(clock=(clock := Clock()))
    clock.now_s = 1.0
    line.add(FACE)
    assert line.text() == "1 frames, 1.0 a second"
    line.total = 11
    assert line.text() == "1 of 11 frames (9 %), 1.0 a second, about 10 s left"


def test_the_rate_is_that_of_the_last_minute_and_remembers_little():
    rate = Rate(clock := Clock())
    for done in range(1, 10_001):
        clock.now_s = done / 100
        rate.add(done)
    assert rate.of(10_000) == pytest.approx(100)
    for late in range(1, 121):
        clock.now_s = 100 + late
        rate.add(10_000 + late)
    assert rate.of(10_120) == pytest.approx(1, rel=0.02)
    assert len(rate._marks) < 105


def test_where_no_line_can_move_there_is_a_plain_one_now_and_then(monkeypatch, capsys):
    monkeypatch.setattr(progress, "_FIRST_S", 0.0)
    monkeypatch.setattr(progress, "_EVERY_S", 0.01)
    said = []
    monkeypatch.setattr(progress, "complain", said.append)
    with BatchProgress(4) as line:
        line.add(FACE)
        until(lambda: any(one.startswith("batch: 1 of 4 frames (25 %), ") for one in said[2:]))
    until(lambda: not any(one.name == "batch progress" for one in threading.enumerate()))
    assert capsys.readouterr() == ("", "")


def test_on_a_terminal_a_bar_moves_below_what_is_said_and_is_gone_at_the_end(monkeypatch, capsys):
    ours, theirs = os.openpty()
    terminal = os.fdopen(theirs, "w", encoding="utf-8")
    shown = []

    def look():
        with suppress(OSError):  # it is closed
            while True:
                shown.append(os.read(ours, 4096))

    def seen():
        return b"".join(shown).decode(errors="replace")

    looking = threading.Thread(target=look, daemon=True)
    looking.start()
    monkeypatch.setattr(sys, "stderr", terminal)
    for name in ("TERM", "COLUMNS"):
        monkeypatch.setenv(name, {"TERM": "xterm", "COLUMNS": "120"}[name])
    stderr = SimpleNamespace(stderr=terminal, stdout=sys.stdout)
    monkeypatch.setattr(_lines, "sys", stderr)
    monkeypatch.setattr(progress, "sys", stderr)
    with BatchProgress(4) as line:
        line.add(NONE)
        until(lambda: "1 without a face" in seen())
        complain("a.oni, frame 3: cannot be read")
        say("a result")
        line.add(FACE)
        until(lambda: "2 of 4 frames" in seen().rpartition("cannot be read")[2])
    terminal.close()
    looking.join(LIMIT_S)
    os.close(ours)
    before, _, after = seen().partition("a.oni, frame 3: cannot be read\r\n")
    assert "━" in before
    assert after
    assert "a result" not in seen()
    assert capsys.readouterr().out == "a result\n"
    assert after.rstrip("\r\n").endswith("\x1b[2K")  # its last line is empty
    assert _lines._aside is not None
    complain("after")  # nothing of the bar is left that would step aside
