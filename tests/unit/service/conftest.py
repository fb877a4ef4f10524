"""What every test here needs."""

from collections.abc import Iterator

import pytest
import structlog

from denseface.service.log.output import process_log
from denseface.service.runtime.terminal.progress import Progress
from tests.waiting import LIMIT_S


@pytest.fixture(autouse=True)
def _nothing_takes_long() -> Iterator[None]:
    """What takes 2 s tells so on stderr: here that says how busy this machine is.

    By a patch of its own: the test's would be made first, and be undone after all other fixtures.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(Progress.__init__.__kwdefaults__, "plain_after_s", LIMIT_S)
        yield


@pytest.fixture(autouse=True)
def _log_as_before() -> Iterator[None]:
    """A command run in this process sets the log up for itself.

    Its thread lives on, and would tell within a later test what was suppressed in this one.
    """
    before = process_log.on_interval, process_log.on_recovery
    yield
    process_log.on_interval, process_log.on_recovery = before
    process_log.flush(LIMIT_S)
    structlog.reset_defaults()
    structlog.contextvars.clear_contextvars()
