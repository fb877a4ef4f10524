"""Whether a kiosk answers, asked of its own machine."""

import re

import pytest

from denseface.service.kiosk.answering import Answer, ask
from denseface.service.kiosk.settings import KioskSettings
from tests.ports import free_port
from tests.unit.service.kiosk.health import answering
from tests.unit.service.kiosk.links.certificate_files import make_certificate


def test_one_that_serves():
    with answering(200, b'{"serving": true, "consent": true}') as (port, hosts):
        assert ask(KioskSettings(address=("127.0.0.1", port))) == Answer("", asks_consent=True)
        # Every address of a container: asked on its loopback, by a name that the page knows.
        assert not ask(KioskSettings(address=("0.0.0.0", port),  # noqa: S104
                                     proxy=("http://localhost:1",))).ailment
    assert hosts[0] == f"127.0.0.1:{port}"
    assert hosts[1] in (f"127.0.0.1:{port}", "localhost:1")


def test_one_with_a_certificate_for_the_name_that_visitors_use(tmp_path):
    make_certificate(tmp_path, "page")
    files = {"certificate": tmp_path / "page.pem", "key": tmp_path / "page.key"}
    tls = KioskSettings(**files).tls()
    with answering(200, b'{"serving": true, "consent": false}', tls) as (port, _):
        assert ask(KioskSettings(address=("127.0.0.1", port), **files)) == Answer(
            "", asks_consent=False)


@pytest.mark.parametrize(("status", "body", "why"), [
    (403, b"", "answers with status 403"), (200, b"hello", "what answers there is no kiosk"),
    (200, b"[]", "what answers there is no kiosk"),
    (200, b"\xff", "what answers there is no kiosk"),
    (200, b'{"serving": true, "consent": "maybe"}', "what answers there is no kiosk"),
    (200, b'{"serving": false}', "what answers there is no kiosk")])
def test_what_is_no_kiosk(status, body, why):
    with answering(status, body) as (port, _):
        assert ask(KioskSettings(address=("127.0.0.1", port))) == Answer(
            f"http://127.0.0.1:{port}: {why}", another=True)


def test_nobody():
    address = "127.0.0.1", free_port()
    nobody = ask(KioskSettings(address=address))
    assert nobody.ailment.endswith(": Connection refused")
    assert not nobody.another
    assert re.search("any free port", ask(KioskSettings(address=("127.0.0.1", 0))).ailment)
