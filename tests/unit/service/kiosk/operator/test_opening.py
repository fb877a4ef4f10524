"""The token of the first start, and who sees it."""

import subprocess
import sys

import pytest

from denseface.service.errors import SettingsError
from denseface.service.kiosk.operator import opening
from denseface.service.kiosk.operator.opening import operator_routes
from denseface.service.kiosk.operator.token import OperatorToken
from denseface.service.kiosk.settings import KioskSettings
from denseface.service.kiosk.web.files import Files
from denseface.service.log.output import process_log
from denseface.service.settings import ServiceSettings
from tests.unit.service.kiosk.operator.desk import Hub


@pytest.fixture
def opened(tmp_path, monkeypatch):
    """Opens the page, on a terminal or not."""
    async def forget(_):
        pass

    def open_page(terminal):
        monkeypatch.setattr(opening.os, "isatty", lambda _: terminal)
        settings = KioskSettings.of({}, folder=tmp_path / "kiosk", lan="127.0.0.1:8090")
        return operator_routes(
            Hub(), ServiceSettings.of({}), settings, Files({}), dict, forget)

    yield open_page
    process_log.keep(0)


def test_a_terminal_is_shown_the_token_once(opened, tmp_path, capfd):
    assert opened(terminal=True)
    # The log may write meanwhile what other tests gave it.
    line, = (line for line in capfd.readouterr().err.splitlines()
             if line.startswith("the operator's token, shown this once: "))
    assert OperatorToken(tmp_path / "kiosk").fits(line.rpartition(": ")[2])
    opened(terminal=True)
    assert "shown" not in capfd.readouterr().err


def test_a_log_is_not_shown_it(opened, tmp_path, capfd):
    opened(terminal=False)
    written = "".join(capfd.readouterr())
    assert "--new-operator-token makes one" in written
    assert "shown" not in written
    assert not OperatorToken(tmp_path / "kiosk").path.exists()


def test_a_token_file_that_others_may_read_stops_the_start(opened, tmp_path):
    OperatorToken(tmp_path / "kiosk").renew()
    (tmp_path / "kiosk" / "operator-token.sha256").chmod(0o644)
    for terminal in (True, False):
        with pytest.raises(SettingsError, match="others may use the operator's token"):
            opened(terminal=terminal)


def test_the_command_makes_another_and_says_it_alone(tmp_path):
    token = OperatorToken(tmp_path / "kiosk")
    before = token.renew()
    done = subprocess.run(
        [sys.executable, "-m", "denseface", "kiosk", "--new-operator-token", "--kiosk-folder",
         tmp_path / "kiosk"], check=True, capture_output=True, text=True)
    assert token.fits(done.stdout)
    assert not token.fits(before)
    assert done.stderr == ""

