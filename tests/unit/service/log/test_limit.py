"""How many lines of one kind there may be."""

import pytest
from structlog import DropEvent

from denseface.service.log.limit import LogLimit


class Log:
    """Gives what is left of what is logged at the time `now`."""

    def __init__(self):
        self.now = 0.0
        self.limit = LogLimit(lambda: self.now)

    def say(self, event, level="warning", **fields):
        try:
            return self.limit(None, level, {"event": event, **fields})
        except DropEvent:
            return None


@pytest.fixture
def log():
    return Log()


@pytest.mark.parametrize(("level", "burst", "every_s"), [
    ("info", 200, 0.05), ("warning", 20, 5), ("error", 20, 5)])
def test_so_many_at_once_and_so_many_in_the_long_run(log, level, burst, every_s):
    assert sum(log.say("x", level) is not None for _ in range(1000)) == burst
    log.now = every_s
    assert log.say("x", level) == {"event": "x", "suppressed": 1000 - burst}
    assert log.say("x", level) is None
    log.now += every_s * 100_000
    assert log.say("x", level) == {"event": "x", "suppressed": 1}


def test_nobody_s_lines_hide_those_of_another_nor_of_another_kind(log):
    while log.say("x", key="a"):
        pass
    assert log.say("x", key="b")
    assert log.say("x")
    assert log.say("y", key="a")


def test_a_kind_may_be_named_and_then_its_text_does_not_count(log):
    assert log.say("0", per=("stderr",)) == {"event": "0"}
    assert sum(log.say(str(number), per=("stderr",)) is not None for number in range(100)) == 19


def test_what_was_suppressed_at_last_is_said_once(log):
    for _ in range(30):
        log.say("refused", per=("refused", "role", "a"))
    assert list(log.limit.suppressed()) == []  # its next line may not come yet
    log.now = 5.0
    assert list(log.limit.suppressed()) == [("refused role a", 10)]
    assert list(log.limit.suppressed()) == []
    log.now = 10.0
    assert log.say("refused", per=("refused", "role", "a")) == {"event": "refused"}


def test_kinds_without_end_take_no_memory(log):
    for number in range(5000):
        log.say("x", key=str(number))
    assert len(log.limit._buckets) == 1024
