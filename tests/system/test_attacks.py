"""Everyone who is not to come in: refused, counted, and the hub goes on."""

import pytest

from tests.system.guarded import guarded_hub, press_through


@pytest.fixture(scope="module")
def hub(tmp_path_factory):
    with guarded_hub(tmp_path_factory.mktemp("hub")) as hub:
        yield hub


def test_a_press_with_keys_gives_a_face(hub):
    press_through(hub, "first")
    assert hub.status().refused == {}
