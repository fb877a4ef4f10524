"""Certificates are looked at before anybody connects."""

import shutil
import subprocess

import pytest

from denseface.service.errors import SettingsError
from denseface.service.kiosk.certificates import tls_context
from tests.unit.service.kiosk.links.certificate_files import make_certificate

pytestmark = pytest.mark.skipif(not shutil.which("openssl"), reason="no openssl to make keys with")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tls")
    make_certificate(folder, "good")
    make_certificate(folder, "other")
    make_certificate(folder, "old", days=0)
    subprocess.run(["openssl", "ec", "-in", folder / "good.key", "-aes128", "-passout", "pass:abcd",
                    "-out", folder / "locked.key"], check=True, capture_output=True)
    (folder / "text.pem").write_text("no certificate\n")
    return folder


def test_a_good_one_is_taken(folder):
    assert tls_context(folder / "good.pem", folder / "good.key", "--lan-certificate")


@pytest.mark.parametrize(("certificate", "key", "words"), [
    ("none.pem", "good.key", r"none\.pem: No such file"),
    ("good.pem", "none.key", r"none\.key: No such file"),
    (".", "good.key", "is a folder"),
    ("text.pem", "good.key", r"text\.pem: no certificate in PEM form"),
    ("good.key", "good.key", r"good\.key: no certificate in PEM form"),
    ("good.pem", "text.pem", r"text\.pem: no secret key in PEM form"),
    ("good.pem", "other.key", r"other\.key: the key is not that of .*good\.pem"),
    ("good.pem", "locked.key", r"locked\.key: the key has a password"),
    ("old.pem", "old.key", r"old\.pem: the certificate has expired"),
])
def test_what_cannot_serve_is_one_line_that_names_setting_and_file(
        folder, certificate, key, words):
    with pytest.raises(SettingsError, match=f"^--lan-certificate: .*{words}") as error:
        tls_context(folder / certificate, folder / key, "--lan-certificate")
    assert "\n" not in str(error.value)
