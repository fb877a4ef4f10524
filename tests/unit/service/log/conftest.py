"""What every test of the log needs."""

import logging
import sys
import threading
import warnings

import pytest


@pytest.fixture(autouse=True)
def _as_before(monkeypatch):
    """Take back what `configure` does to all of Python: a later test would find it."""
    for module, name in ((sys, "excepthook"), (sys, "unraisablehook"), (threading, "excepthook"),
                         (sys, "stderr"), (warnings, "showwarning")):
        monkeypatch.setattr(module, name, getattr(module, name))
    before = logging.root.handlers[:]
    yield
    logging.root.handlers[:] = before
