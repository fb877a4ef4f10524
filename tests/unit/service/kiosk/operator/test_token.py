"""The operator's token and its file."""

import pytest

from denseface.service.errors import SettingsError
from denseface.service.kiosk.operator.token import OperatorToken


def test_a_token_is_given_once_and_only_its_hash_is_kept_for_this_user_alone(tmp_path):
    token = OperatorToken(tmp_path / "kiosk")
    secret = token.ensure()
    assert secret
    assert len(secret.replace("-", "")) * 4.9 > 128  # 31 letters and digits
    assert token.ensure() is None
    assert token.path.stat().st_mode & 0o777 == 0o600
    assert token.path.parent.stat().st_mode & 0o777 == 0o700
    assert secret not in token.path.read_text()
    assert secret.replace("-", "") not in token.path.read_text()
    for typed in (secret, secret.upper(), secret.replace("-", ""), f" {secret} \n",
                  secret.replace("-", " ")):
        assert token.fits(typed)
    for wrong in ("", "x", secret[:-1], secret + "a", token.path.read_text().strip(), "\udcff"):
        assert not token.fits(wrong)


def test_another_token_replaces_it(tmp_path):
    token = OperatorToken(tmp_path / "kiosk")
    first = token.ensure()
    second = token.renew()
    assert first != second
    assert token.fits(second)
    assert not token.fits(first)


def test_a_file_that_is_open_to_others_or_none_is_one_line(tmp_path):
    token = OperatorToken(tmp_path / "kiosk")
    with pytest.raises(SettingsError, match="--new-operator-token makes one"):
        token.digest()
    token.ensure()
    token.path.chmod(0o640)
    with pytest.raises(SettingsError, match=r"others may use the operator's token \(mode 640\)"):
        token.ensure()
    token.path.chmod(0o600)
    for text in ("", "0000", "x" * 64, "a" * 1000):
        token.path.write_text(text)
        with pytest.raises(SettingsError, match=r"--new-operator-token|more than"):
            token.fits("0000")


def test_a_folder_that_others_may_use_is_refused(tmp_path):
    folder = tmp_path / "kiosk"
    folder.mkdir(mode=0o755)
    with pytest.raises(SettingsError, match="others may use this folder"):
        OperatorToken(folder).ensure()
