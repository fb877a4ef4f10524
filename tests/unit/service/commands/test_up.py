"""What `up` passes on to each sensor's process."""

import argparse
from pathlib import Path

import pytest
from structlog.testing import capture_logs

from denseface.service.commands import up
from denseface.service.commands.up import _captures
from denseface.service.errors import SettingsError


@pytest.mark.parametrize(("rotations", "given"), [
    ([], ([], [])),
    ([90], (["--rotate=90"], ["--rotate=90"])),
    ([0, 270], (["--rotate=0"], ["--rotate=270"]))])
def test_a_rotation_is_for_all_sensors_or_one_for_each(rotations, given):
    first, second = _captures(["a", "b"], [Path("c"), Path("d")], rotations)
    assert first == ["--source=a", "--calibration=c", *given[0]]
    assert second == ["--source=b", "--calibration=d", *given[1]]


@pytest.fixture
def kiosk(monkeypatch):
    """Give what `up` passes on to the kiosk's process."""
    monkeypatch.delenv("DENSEFACE_KIOSK", raising=False)
    monkeypatch.setattr("denseface.service.kiosk.installed.why_not", lambda: None)

    def given(*flags):
        parser = argparse.ArgumentParser()
        up.add_arguments(parser)
        return up._kiosk(parser.parse_args(flags))

    return given


def test_there_is_a_kiosk_with_its_flags_unless_it_is_switched_off(kiosk, monkeypatch):
    assert kiosk() == []
    assert kiosk("--kiosk-countdown", "0", "--kiosk-sound", "on") == [
        "--kiosk-countdown=0", "--kiosk-sound=on"]
    assert kiosk("--no-kiosk") is None
    monkeypatch.setenv("DENSEFACE_KIOSK", "off")
    assert kiosk() is None
    monkeypatch.setenv("DENSEFACE_KIOSK", "no")
    with pytest.raises(SettingsError, match="DENSEFACE_KIOSK: expected on or off, found 'no'"):
        kiosk()


def test_where_it_is_not_installed_one_line_says_so(kiosk, monkeypatch):
    monkeypatch.setattr("denseface.service.kiosk.installed.why_not", lambda: "no kiosk: because")
    with capture_logs() as logs:
        assert kiosk() is None
    assert [(line["log_level"], line["event"]) for line in logs] == [("info", "no kiosk: because")]


@pytest.mark.parametrize(("flags", "message"), [
    (["--kiosk-countdown", "x"], "--kiosk-countdown: "),
    (["--kiosk-certificate", "none.pem", "--kiosk-key", "none.pem"], "--kiosk-certificate: none"),
    (["--kiosk-consent-text", "none.json"], "--kiosk-consent-text: none.json: No such file")])
def test_what_the_kiosk_could_not_use_is_said_before_anything_is_started(kiosk, flags, message):
    with pytest.raises(SettingsError, match=message):
        kiosk(*flags)
