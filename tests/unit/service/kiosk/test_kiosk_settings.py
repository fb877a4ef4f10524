"""The kiosk's settings: each is checked, and what is wrong is named."""

import re
from pathlib import Path

import pytest

from denseface.service.commands._options.kiosk import KIOSK_FLAGS
from denseface.service.errors import SettingsError
from denseface.service.kiosk.settings import KioskSettings

OPERATING = Path(__file__).resolve().parents[4] / "docs" / "operating.md"


def test_a_flag_wins_over_the_environment_and_that_over_the_default():
    settings = KioskSettings.of(
        {"DENSEFACE_KIOSK_COUNTDOWN": "5", "DENSEFACE_KIOSK_SOUND": "on", "DENSEFACE_KIOSK": "off"},
        countdown="0", sensor=None)
    assert (settings.countdown, settings.sound, settings.speech) == (0, True, True)
    assert settings.address == ("127.0.0.1", 8080)
    assert settings.scheme == "http"


@pytest.mark.parametrize(("flags", "message"), [
    ({"address": "http"}, "--kiosk-address: expected PORT, or an IP address and a port"),
    ({"address": "127.0.0.1:65536"}, "--kiosk-address: expected PORT"),
    ({"address": "localhost:8080"}, "--kiosk-address: expected PORT"),
    ({"address": "off"}, "--kiosk-address: "),
    ({"address": "0.0.0.0:8080"}, "--kiosk-address: 0.0.0.0:8080 can be reached from other "
                                  "machines: expected a TLS certificate"),
    ({"address": "[::]:8080"}, "can be reached from other machines"),
    ({"certificate": "a.pem"}, "expected both --kiosk-certificate and --kiosk-key, or neither"),
    ({"lan_key": "a.pem"}, "expected both --kiosk-lan-certificate and --kiosk-lan-key"),
    ({"proxy": "face.example"}, "--kiosk-proxy: expected origins as a browser writes them"),
    ({"proxy": "https://face.example/"}, "--kiosk-proxy: expected origins"),
    ({"proxy": "https://face.example:443"}, "--kiosk-proxy: expected origins"),
    ({"proxy": "https://me@face.example"}, "--kiosk-proxy: expected origins"),
    ({"proxy": "https://FACE.example"}, "--kiosk-proxy: expected origins"),
    ({"proxy": "https://a.example,null"}, "--kiosk-proxy: expected origins"),
    ({"sound": "yes"}, "--kiosk-sound: expected on or off, found 'yes'"),
    ({"countdown": "11"}, "--kiosk-countdown: .*expected at most 10"),
    ({"languages": "en,Deutsch"}, "--kiosk-languages: expected names such as de or pt-BR, found"),
    ({"languages": ","}, "--kiosk-languages: .*at least 1"),
    ({"link_uses": "0"}, "--kiosk-link-uses: "),
    ({"link_minutes": "nan"}, "--kiosk-link-minutes: "),
    ({"idle_s": "1"}, "--kiosk-idle-s: "),
])
def test_a_wrong_setting_is_named_in_one_line(flags, message):
    with pytest.raises(SettingsError, match=message) as raised:
        KioskSettings.of({}, **flags)
    assert len(str(raised.value).splitlines()) == 1


def test_a_wrong_variable_is_named():
    with pytest.raises(SettingsError, match=r"^DENSEFACE_KIOSK_AUTO: expected on or off"):
        KioskSettings.of({"DENSEFACE_KIOSK_AUTO": "maybe"})


@pytest.mark.parametrize("flags", [
    {"certificate": "a", "key": "b"}, {"proxy": "https://face.example"}])
def test_off_the_loopback_with_a_certificate_or_behind_a_proxy(flags):
    assert KioskSettings.of({}, address="[::]:443", **flags).address == ("::", 443)


def test_a_certificate_that_cannot_be_used_is_named(tmp_path):
    pem = tmp_path / "page.pem"
    settings = KioskSettings.of({}, certificate=pem, key=pem)
    with pytest.raises(SettingsError, match=re.escape(f"--kiosk-certificate: {pem}: No such")):
        settings.tls()
    pem.write_text("no certificate")
    with pytest.raises(SettingsError, match=f"--kiosk-certificate: {pem}: no cert"):
        settings.tls()


def test_every_setting_has_a_flag_and_a_row_in_the_docs():
    names = set(KioskSettings.model_fields)
    assert {flag.replace("-", "_") for flag in KIOSK_FLAGS} == names
    text = OPERATING.read_text()
    assert {name for name in names if f"`DENSEFACE_KIOSK_{name.upper()}`" in text} == names
    assert {flag for flag in KIOSK_FLAGS if f"`--kiosk-{flag}`" in text} == set(KIOSK_FLAGS)


def test_the_help_names_every_default():
    defaults = {"on": True, "off": (False, None), "none": None}
    fields = KioskSettings.model_fields
    for flag, (_, text) in KIOSK_FLAGS.items():
        if found := re.search(r"\(default: (on|off|none|\d+)\)", text):
            default = fields[flag.replace("-", "_")].default
            expected = defaults.get(found[1], found[1])
            assert default in expected if isinstance(expected, tuple) else (
                default == expected or str(default).removesuffix(".0") == expected), flag
