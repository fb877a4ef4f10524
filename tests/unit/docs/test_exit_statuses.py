"""docs/operating.md and the help tell the exit statuses that commands have."""

import re
import signal
from pathlib import Path

import pytest

import denseface
from denseface.service import errors as service_errors
from denseface.service.cli import _examples, _main, _parser

PAGE = (Path(__file__).resolve().parents[3] / "docs" / "operating.md").read_text()
SECTION = PAGE.partition("\n## Exit status\n")[2].partition("\n## ")[0]
ROWS = {tuple(map(int, row[1].split(", "))): row[2] for row in re.finditer(
    r"^\| ([\d, ]+) \| (.+) \|$", SECTION, re.MULTILINE)}
FAILED, WRONG = 1, 2
"""What a command that did not do its job ends with."""


def test_the_page_has_each_status_once():
    assert sorted(sum(ROWS, ())) == sorted({
        0, FAILED, WRONG, *(128 + number for number in (
            signal.SIGHUP, signal.SIGINT, signal.SIGTERM, signal.SIGPIPE))})
    assert (_main._FAILED, _parser.USAGE, _main._CTRL_C, _main._BROKEN_PIPE) == (1, 2, 130, 141)


def test_the_help_has_the_same():
    told = _examples.EXIT_STATUSES.partition(":")[2]
    assert set(map(int, re.findall(r"\b\d+\b", told))) == set(sum(ROWS, ()))


@pytest.mark.parametrize(("status", "names"), [
    (FAILED, "NoFaceError NoDepthError SensorError SensorTimeoutError PressRefusedError "
             "CaptureFailedError UnknownCaptureError ClientTimeoutError KeyRefusedError"),
    (WRONG, "UnreadableSourceError CalibrationError FrameError FormatError SettingsError "
            "AddressError KeyFileError LocalProtocolError DriverError MissingPackageError"),
])
def test_what_the_page_says_failed_and_what_is_wrong(status, names):
    arguments = {"PressRefusedError": ("busy", "busy", (), ""),
                 "CaptureFailedError": ("a1", "NoFaceError", "no face")}
    for name in names.split():
        error = getattr(denseface, name)(*arguments.get(name, ("x",)))
        assert _main._exit_status(error) == status, name
    assert _main._exit_status(service_errors.StoreError("disk full")) == FAILED
    for words in {FAILED: ("no face", "no hub", "no sensor", "full disk"),
                  WRONG: ("wrong usage", "setting", "not installed", "cannot be read")}[status]:
        assert words in ROWS[status,]
