"""One process compiles, the others wait for it and say so."""

import logging
import threading

import pytest

from denseface.recon.numerics.compilation import progress
from denseface.recon.numerics.compilation.progress import LOGGER, Compiling
from tests.waiting import LIMIT_S, until


class Kernel:
    def __init__(self, ready):
        self.signatures = [()] * ready


@pytest.fixture(autouse=True)
def heard(caplog, monkeypatch):
    """Also where a command has run here, which takes it for itself."""
    monkeypatch.setattr(logging.getLogger(LOGGER), "propagate", True)
    caplog.set_level(logging.INFO, LOGGER)


def states(caplog):
    return [(one.progress.state, one.progress.done, one.progress.total)
            for one in caplog.records if one.name == LOGGER]


def test_who_comes_second_waits_and_tells_how_far_the_first_is(tmp_path, caplog):
    first, second = Compiling(), Compiling()  # each opens the file, as two processes do
    for number in range(3):
        first.add(Kernel(number < 2))
    got = threading.Event()

    def wait():
        with second.session():
            assert second.take_turn(lambda: tmp_path)
            got.set()

    waiting = threading.Thread(target=wait)
    with first.session():
        first.take_turn(lambda: tmp_path)
        first.begin_one()
        first.end_one("")
        waiting.start()
        until(lambda: ("waiting", 2, 3) in states(caplog))
        assert not got.is_set()
    waiting.join(LIMIT_S)
    assert got.is_set()
    assert states(caplog)[-1][0] == "compiled", "and says that the waiting is over"


def test_who_waits_for_one_that_does_not_get_on_begins_itself(tmp_path, monkeypatch):
    monkeypatch.setattr(progress, "_PATIENCE_S", 0.0)
    stopped, other = Compiling(), Compiling()
    stopped.take_turn(lambda: tmp_path)
    assert other.take_turn(lambda: tmp_path)
    other.give_turn()
    stopped.give_turn()


def test_nobody_waits_where_no_file_can_be_locked(tmp_path):
    one = Compiling()
    assert one.take_turn(lambda: None)
    assert not one.take_turn(lambda: None), "it is this process's turn already"
    one.give_turn()
    (tmp_path / "denseface.lock").symlink_to("/dev/null")
    assert one.take_turn(lambda: tmp_path)


def test_what_is_compiled_outside_a_session_is_not_told(tmp_path, caplog):
    one = Compiling()
    one.take_turn(lambda: tmp_path)
    one.begin_one()
    one.end_one("")
    assert not states(caplog)
    assert Compiling().take_turn(lambda: tmp_path), "and holds nobody up"
