"""Where a user's files are."""

from pathlib import Path

import pytest

from denseface.folders import user_folder


@pytest.mark.parametrize(("given", "found"), [
    ("/etc/other", "/etc/other/denseface"), ("", "/srv/me/.config/denseface"),
    (None, "/srv/me/.config/denseface"), ("relative", "/srv/me/.config/denseface")])
def test_a_folder_is_the_variables_or_below_the_home(monkeypatch, given, found):
    monkeypatch.setenv("HOME", "/srv/me")
    if given is None:
        monkeypatch.delenv("XDG_CONFIG_HOME", raising=False)
    else:
        monkeypatch.setenv("XDG_CONFIG_HOME", given)
    assert user_folder("config") == Path(found)


@pytest.mark.parametrize("home", [None, "/srv/xdg", "xdg"])
@pytest.mark.parametrize("kind", ["config", "data", "state"])
def test_platformdirs_finds_the_same(monkeypatch, kind, home):
    """It was asked in earlier releases, whose keys and captures are where it said."""
    platformdirs = pytest.importorskip("platformdirs")
    monkeypatch.setenv("HOME", "/srv/me")
    if home is None:
        monkeypatch.delenv(f"XDG_{kind.upper()}_HOME", raising=False)
    else:
        monkeypatch.setenv(f"XDG_{kind.upper()}_HOME", home)
    assert user_folder(kind) == getattr(platformdirs, f"user_{kind}_path")("denseface")
