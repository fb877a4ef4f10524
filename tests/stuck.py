"""The end of a test that its time-out does not end: pytest's plugin `tests.conftest` registers it.

The time-out raises an error in the test, and the test may go on waiting for all that: for a thread
of its own that never ends, or in C. Then the whole run would wait. So each part of a test (its
fixtures, itself, what is undone) has some time more, and then every thread's stack is written and
the process ends. pytest-xdist names the test, and goes on with another worker.
"""

import faulthandler
import os
from collections.abc import Generator

import pytest

from tests.waiting import PATIENCE

__all__ = ["MORE_S"]

MORE_S = 60.0 * PATIENCE
"""Seconds that a test has beyond its time-out."""

_stderr = pytest.StashKey[int]()


def pytest_configure(config: pytest.Config) -> None:
    """Keep where errors go: while a test runs, that is captured."""
    config.stash[_stderr] = os.dup(2)


@pytest.hookimpl(tryfirst=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    """Have so much time for what is undone only now, after an error within pytest.

    A time-out leads to one that comes while pytest writes down how a test failed.
    """
    _end_in(session.config, float(session.config.option.timeout))


def pytest_unconfigure(config: pytest.Config) -> None:
    """Give it back."""
    faulthandler.cancel_dump_traceback_later()
    os.close(config.stash[_stderr])


def _end_in(config: pytest.Config, seconds: float) -> None:
    if seconds:
        faulthandler.dump_traceback_later(
            seconds + MORE_S, exit=True, file=config.stash[_stderr])


@pytest.hookimpl(wrapper=True, tryfirst=True)
def _ended_in_time(item: pytest.Item) -> Generator[None, object, object]:
    mark = item.get_closest_marker("timeout")
    _end_in(item.config, float(mark.args[0] if mark else item.config.option.timeout))
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()


# Anew for each part: pytest calls it off once a part has failed.
pytest_runtest_setup = pytest_runtest_call = pytest_runtest_teardown = _ended_in_time
