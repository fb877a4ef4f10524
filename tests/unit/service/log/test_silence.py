"""What a test has set up in the log of this process ends with it; in the order of this file."""

import threading

import structlog

from denseface.service.log.events import configure
from denseface.service.log.output import process_log

_told = threading.Event()


def test_a_test_may_have_the_log_speak_on_its_own(monkeypatch):
    monkeypatch.setattr("sys.stderr", None)
    configure("text", "test")
    process_log.on_interval = _told.set
    assert structlog.is_configured()


def test_nothing_of_it_is_said_in_the_next_one():
    process_log.on_interval()
    assert not _told.is_set()
    assert not structlog.is_configured()
