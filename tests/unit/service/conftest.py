"""What every test here needs."""

from collections.abc import Iterator

import pytest
import structlog


@pytest.fixture(autouse=True)
def _log_as_before() -> Iterator[None]:
    """A command run in this process sets the log up for itself."""
    yield
    structlog.reset_defaults()
    structlog.contextvars.clear_contextvars()
