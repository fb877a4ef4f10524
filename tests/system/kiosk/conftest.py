"""One service and one browser for all tests of a module."""

import pytest

from tests.system.kiosk.browsing import chromium
from tests.system.kiosk.serving import serving


@pytest.fixture(scope="module")
def served(tmp_path_factory):
    """The whole service, its page and a sensor that can be unplugged."""
    with serving(tmp_path_factory.mktemp("kiosk"), "--kiosk-countdown", "1",
                 "--kiosk-measurements", "on", "--metrics", "0") as running:
        yield running


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium."""
    with chromium() as running:
        yield running
