"""A hub to be attacked."""

import pytest

from denseface.service.client import Client
from denseface.service.errors import UnknownCaptureError
from denseface.service.security import read_pair
from tests.system.guarded import Peer, guarded_hub, press_through
from tests.waiting import LIMIT_S, until


@pytest.fixture(scope="module")
def hub(tmp_path_factory):
    """One hub for all attacks; at the end it must still make a face."""
    with guarded_hub(tmp_path_factory.mktemp("hub")) as hub:
        press_through(hub, "first")
        assert hub.status().refused == {}
        yield hub
        press_through(hub, "last")
        with pytest.raises(UnknownCaptureError), Client(hub.local) as client:
            client.get("attack", timeout=LIMIT_S)  # nothing of any attack became a capture
        # Garbage does not fill the disk, and no secret reaches the log.
        assert len(hub.log.read_text().splitlines()) < 300
        for path in hub.keys.glob("*.secret"):
            assert read_pair(path).secret not in hub.log.read_text()


@pytest.fixture
def refused(hub):
    """Gives what waits until more was refused for a reason than before the test."""
    before = hub.status().refused

    def more(reason, by=1):
        until(lambda: hub.refused(reason) - before.get(reason, 0) >= by)

    return more


@pytest.fixture
def connect(hub):
    """Opens connections and closes them."""
    peers = []

    def open_peer(*arguments, **named):
        peers.append(Peer(*arguments, **named))
        return peers[-1]

    yield open_peer
    for peer in peers:
        peer.close()
