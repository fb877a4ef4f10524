"""How long tests may take, and how property tests choose their examples."""

import inspect
import os
import signal
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

from denseface.service.client import AsyncClient, Client, Operator
from tests import stuck
from tests.waiting import PATIENCE, SERVICE

# No time limit for one example: a machine that is busy for a moment proves nothing. The same
# examples in every run, so that what passes once passes again; others are looked for with
# `script/test --hypothesis-profile search`.
settings.register_profile("same", deadline=None, derandomize=True)
settings.register_profile("search", deadline=None)
settings.load_profile("same")

# Hundreds of processes are started here, and each would compile all of denseface once more where
# the bytecode is not kept: a fifth of what their starts cost. Kernels are kept beside it anyway.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Set here and there, and not where somebody tries this first.
os.environ.pop("PYTHONUNBUFFERED", None)

# Many services run at once, and one port is enough for one page: who tests that asks for it.
os.environ.setdefault("DENSEFACE_KIOSK", "off")

# The service, and the clients' requests that a test gives no time-out, may take longer, too.
os.environ.update({name: value for name, value in SERVICE.items() if name not in os.environ})
for _method in {method for client in (AsyncClient, Client, Operator)
                for _, method in inspect.getmembers(client, inspect.isfunction)}:
    _defaults = _method.__kwdefaults__ or {}
    if isinstance(_defaults.get("timeout"), float):
        _defaults["timeout"] *= PATIENCE

# What a shell starts in the background ignores Ctrl-C, and so would every process of a test.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)


@pytest.hookimpl(tryfirst=True)
def pytest_configure(config: pytest.Config) -> None:
    """Let a slow machine take longer for a test; who names --timeout means it."""
    if config.option.timeout is None:
        config.option.timeout = float(config.getini("timeout")) * PATIENCE
    config.pluginmanager.register(stuck)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with what takes long: then no worker has it left when the others are done."""
    items.sort(key=lambda item: "system" not in item.path.parts)


def pytest_itemcollected(item: pytest.Item) -> None:
    """Let a slow machine take longer for a test with a time-out of its own, too."""
    for mark in item.iter_markers("timeout"):
        seconds, = mark.args
        item.add_marker(pytest.mark.timeout(seconds * PATIENCE), append=False)
        break


@pytest.fixture
def heard_sighup() -> Iterator[None]:
    """Have SIGHUP heard where the tests were started by `nohup`."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)
