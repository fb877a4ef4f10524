"""How long tests may take, and how property tests choose their examples."""

import pytest
from hypothesis import settings

from tests.waiting import PATIENCE

# No time limit for one example: a machine that is busy for a moment proves nothing. The same
# examples in every run, so that what passes once passes again; others are looked for with
# `script/test --hypothesis-profile search`.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Let a slow machine take longer for a test; who names --timeout means it."""
    if config.option.timeout is None:
        config.option.timeout = float(config.getini("timeout")) * PATIENCE


def pytest_itemcollected(item: pytest.Item) -> None:
    """Let a slow machine take longer for a test with a time-out of its own, too."""
    for mark in item.iter_markers("timeout"):
        seconds, = mark.args
        item.add_marker(pytest.mark.timeout(seconds * PATIENCE), append=False)
        break
