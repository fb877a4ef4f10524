"""Calls in a thread, one at a time and one behind it."""

import threading
from types import SimpleNamespace

import pytest

from denseface.service.runtime import background
from denseface.service.runtime.background import Background
from tests.waiting import LIMIT_S


@pytest.fixture
def calls():
    with Background("test") as background:
        yield background


def test_the_call_that_waits_begins_when_the_one_before_ends(calls):
    first, second = threading.Event(), threading.Event()
    calls.start(lambda: first.wait(LIMIT_S) and "first")
    calls.start(lambda: second.set() or "second")
    with pytest.raises(RuntimeError, match="waits already"):
        calls.start(lambda: "third")
    assert not second.is_set()
    first.set()
    assert second.wait(LIMIT_S)  # though nobody asked for the first result
    assert calls.result() == "first"
    assert calls
    assert calls.result() == "second"
    assert not calls


def test_a_call_that_waits_can_be_cancelled_one_that_has_begun_cannot(calls):
    gate, begun = threading.Event(), threading.Event()
    calls.start(lambda: begun.set() or gate.wait(LIMIT_S))
    assert begun.wait(LIMIT_S)
    assert not calls.cancel_queued()
    calls.start(lambda: pytest.fail("was cancelled"))
    assert calls.cancel_queued()
    gate.set()
    assert calls.result()
    assert not calls.cancel_queued()


def test_a_call_that_has_begun_by_itself_cannot_be_cancelled(calls):
    gate, begun = threading.Event(), threading.Event()
    calls.start(lambda: "first")
    calls.start(lambda: begun.set() or gate.wait(LIMIT_S))
    assert begun.wait(LIMIT_S)
    assert not calls.cancel_queued()
    gate.set()
    assert calls.result() == "first"
    assert calls.result() is True


def test_the_time_is_that_of_the_call_under_way(calls, monkeypatch):
    now = [100.0]
    monkeypatch.setattr(background, "time", SimpleNamespace(monotonic=lambda: now[0]))
    assert calls.elapsed_s == 0
    gates, begun = [threading.Event(), threading.Event()], [threading.Event(), threading.Event()]
    for number in range(2):
        calls.start(lambda number=number: begun[number].set() or gates[number].wait(LIMIT_S))
    assert begun[0].wait(LIMIT_S)
    now[0] = 105.0
    assert calls.elapsed_s == 5
    gates[0].set()
    assert begun[1].wait(LIMIT_S)
    now[0] = 107.0
    assert calls.elapsed_s == 2
    gates[1].set()
    assert calls.result()
    assert calls.result()


def test_what_a_call_raises_is_raised_by_result_and_the_next_goes_on(calls):
    def fails():
        raise ValueError("no")

    calls.start(fails)
    calls.start(lambda: "fine")
    with pytest.raises(ValueError, match="no"):
        calls.result()
    assert calls.result() == "fine"
    with pytest.raises(RuntimeError, match="no call"):
        calls.result()
