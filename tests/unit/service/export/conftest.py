"""Short and small loops of the face that turns: what is drawn, at its size, is looked at once."""

import pytest

from denseface.service.export.turning import animation, views


@pytest.fixture(autouse=True)
def _short_loops(monkeypatch):
    monkeypatch.setattr(views, "_FRAMES", 4)
    monkeypatch.setattr(animation, "_CODECS", ("mp4v",))
    for module in (views, animation):
        monkeypatch.setattr(module, "WIDTH", 96)
        monkeypatch.setattr(module, "HEIGHT", 120)


@pytest.fixture
def no_picture(monkeypatch):
    """Draw none, where it does not matter what is in it: that takes a second."""
    monkeypatch.setattr("denseface.service.export.render.render", lambda _: b"a picture" * 99)
