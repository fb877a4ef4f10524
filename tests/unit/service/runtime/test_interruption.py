"""Signals end a command quietly, whenever they come."""

import gc
import os
import signal
import subprocess
import sys
import threading
from contextlib import suppress

import pytest

from denseface.service.runtime import interruption
from denseface.service.runtime.interruption import Interruption, interrupted
from tests.waiting import LIMIT_S, until

ANSWERS = [(signal.SIGINT, KeyboardInterrupt, 130), (signal.SIGTERM, SystemExit, 143),
           (signal.SIGHUP, SystemExit, 129)]
_STEPS = """
import os, signal, sys
point, *sys.argv[1:] = sys.argv[1:]
steps = 0
def step(event, given):
    global steps
    handled = signal.getsignal(signal.SIGINT) is not signal.default_int_handler
    if handled and event in ("import", "open", "compile", "exec"):
        steps += 1
        if steps == int(point):
            os.kill(os.getpid(), 2)
sys.addaudithook(step)
try:
    from denseface.__main__ import run
    sys.exit(run())
finally:
    if steps < int(point):
        os.write(1, b"\\n%d" % steps)
"""
"""`denseface`, interrupted at one of its steps."""


@pytest.mark.usefixtures("heard_sighup")
@pytest.mark.parametrize(("number", "kind", "status"), ANSWERS)
def test_a_signal_is_raised_and_handlers_are_as_before(number, kind, status):
    before = signal.getsignal(number)
    with pytest.raises(kind) as raised, Interruption():
        signal.raise_signal(number)
    assert interrupted() == status
    assert getattr(raised.value, "code", status) == status
    assert signal.getsignal(number) is before


@pytest.fixture
def module(tmp_path, monkeypatch):
    """A module that is interrupted by its own second line."""
    name = f"interrupted_{os.getpid()}"
    (tmp_path / f"{name}.py").write_text(
        "import signal\nsignal.raise_signal(signal.SIGINT)\nwhole = True\n")
    monkeypatch.syspath_prepend(tmp_path)
    yield name
    sys.modules.pop(name, None)


def test_an_import_is_whole_before_a_signal_is_raised(module):
    def run():
        with Interruption():
            __import__(module)
            assert sys.modules[module].whole
            until(lambda: False)

    with pytest.raises(KeyboardInterrupt):
        run()


class Finalised:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)


def test_a_signal_that_a_finaliser_loses_comes_again(capfd):
    def run():
        with Interruption():
            one = Finalised()
            del one
            gc.collect()
            until(lambda: False)

    with pytest.raises(KeyboardInterrupt):
        run()
    assert capfd.readouterr() == ("", "")


def test_what_a_finaliser_raises_otherwise_is_told(monkeypatch):
    told = []
    monkeypatch.setattr(sys, "__unraisablehook__", told.append)

    class Wrong:
        def __del__(self):
            raise ValueError("wrong")

    with Interruption():
        one = Wrong()
        del one
        gc.collect()
    assert [type(one.exc_value) for one in told] == [ValueError]


def test_what_a_half_made_thing_raises_after_a_signal_is_not_told(capfd):
    class HalfMade:
        def __init__(self):
            signal.raise_signal(signal.SIGINT)
            self.made = True

        def __del__(self):
            assert self.made

    with Interruption():
        with suppress(KeyboardInterrupt):
            HalfMade()
        gc.collect()
    assert capfd.readouterr() == ("", "")


def test_another_handler_that_came_meanwhile_gets_the_signal(module):
    got = []
    with Interruption():
        __import__(module)
        before = signal.signal(signal.SIGINT, lambda number, _: got.append(number))
        until(lambda: got)
        signal.signal(signal.SIGINT, before)
    assert got == [signal.SIGINT]


def test_what_is_ignored_stays_so():
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        with Interruption():
            signal.raise_signal(signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_thread_runs_a_command_without_signals():
    done = []

    def run():
        with Interruption():
            done.append(True)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert done == [True]
    assert not interruption._raising


def interrupted_at(step, folder):
    return subprocess.run(
        [sys.executable, "-c", _STEPS, str(step), "keys", "list"], capture_output=True, text=True,
        timeout=LIMIT_S, check=False,
        env=os.environ | {"PYTHONPATH": ":".join(sys.path), "DENSEFACE_KEYS": str(folder)})


def test_ctrl_c_at_any_step_says_nothing(tmp_path):
    interrupted_at(10**9, tmp_path)  # what is compiled takes steps, and is not compiled again
    steps = int(interrupted_at(10**9, tmp_path).stdout.split("\n")[-1])
    for step in (1, 40, steps // 2, steps - 100, steps - 8):
        ended = interrupted_at(step, tmp_path)
        assert (ended.returncode, ended.stderr) == (130, ""), step
