"""What the doctor says of the kiosk."""

import json
from contextlib import contextmanager

import pytest

from denseface.service.commands.sensor import _kiosk_findings
from denseface.service.commands.sensor._kiosk_findings import look_at_kiosk
from denseface.service.tools.doctor.findings import Level
from tests.unit.service.kiosk.health import answering
from tests.waiting import LIMIT_S


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    monkeypatch.setattr(_kiosk_findings, "why_not", lambda: None)
    monkeypatch.setattr(_kiosk_findings, "_ANSWER_S", LIMIT_S)


@contextmanager
def kiosk(answer):
    """One that answers so; gives its address."""
    with answering(200, answer) as (port, _):
        yield f"127.0.0.1:{port}"


def found(address="127.0.0.1:0", **environment):
    return [(one.level, one.text) for one in look_at_kiosk(
        {"DENSEFACE_KIOSK_ADDRESS": address} | environment)]


def test_what_is_missing_is_no_fault(monkeypatch):
    monkeypatch.setattr(_kiosk_findings, "why_not", lambda: "no kiosk: x is not installed")
    assert found() == [(Level.OK, "cannot be served here: x is not installed")]


def test_a_consent_that_is_switched_off_is_a_warning():
    assert [level for level, _ in found()] == [Level.OK]
    (_, first), (level, text) = found(DENSEFACE_KIOSK_CONSENT="off")
    assert first == "can be served at http://127.0.0.1:0; none answers there now"
    assert (level, text) == (Level.WARNING, "nobody is asked before a picture is taken")


def test_the_kiosk_that_runs_knows_better_than_the_environment(monkeypatch):
    monkeypatch.setenv("http_proxy", "http://127.0.0.1:9")
    with kiosk(json.dumps({"serving": True, "consent": False}).encode()) as address:
        assert found(address) == [
            (Level.OK, f"serves at http://{address}"),
            (Level.WARNING, "nobody is asked before a picture is taken")]
    with kiosk(json.dumps({"serving": True, "consent": True}).encode()) as address:
        assert found(address, DENSEFACE_KIOSK_CONSENT="off") == [
            (Level.OK, f"serves at http://{address}")]


@pytest.mark.parametrize("answer", [b"", b"<html>", b"[1]", b'{"consent": false}', b"\xff"])
def test_another_program_at_that_address_is_not_believed(answer):
    with kiosk(answer) as address:
        assert found(address) == [
            (Level.WARNING, f"http://{address}: what answers there is no kiosk")]


def test_a_wrong_setting_is_a_problem():
    ((level, text),) = found(DENSEFACE_KIOSK_CONSENT="perhaps")
    assert (level, text) == (
        Level.PROBLEM, "DENSEFACE_KIOSK_CONSENT: expected on or off, found 'perhaps'")
