"""A subscriber's key that says too much to the publications."""

from pathlib import Path

import zmq

from denseface.service.protocol import messages
from denseface.service.security import read_pair, read_public
from denseface.service.transport.addresses import publications_of
from tests.system.guarded import as_role, leave
from tests.waiting import LIMIT_MS, LIMIT_S, PATIENCE, until
from tests.zmtp import RawSubscriber

_TOPICS = 4000
"""Of 950 bytes, at 45 kB of libzmq's memory each: 180 MB."""
_MOST_MORE_MB = 60
"""Memory that the hub may need beyond what it had."""


def test_what_a_subscriber_may_say_goes_on_for_long(hub, connect):
    """Whoever changes its subscriptions now and then is not cut off."""
    peer = connect(*as_role(hub, "subscriber", zmq.SUB))
    before = hub.refused("subscriptions")
    for _ in range(8):
        peer.socket.subscribe("status")
        assert peer.socket.poll(LIMIT_MS)
        peer.socket.recv_multipart()
        peer.socket.unsubscribe("status")
    assert hub.refused("subscriptions") == before


def test_topics_without_end_cost_the_hub_nothing(hub, connect, refused):
    """In libzmq one call takes them, in which nothing of the hub's own runs."""
    other = connect(*as_role(hub, "subscriber", zmq.SUB))
    other.socket.subscribe("status")
    assert other.socket.poll(LIMIT_MS)
    before = _peak_mb(hub.process.pid)
    pair = read_pair(hub.secret("subscriber"))
    with zmq.Context() as context, context.socket(zmq.XSUB) as flood:
        flood.set(zmq.SNDHWM, 0)
        flood.set(zmq.LINGER, 0)
        flood.curve_serverkey = read_public(hub.hub_key).encode()
        flood.curve_publickey, flood.curve_secretkey = pair.public.encode(), pair.secret.encode()
        for number in range(_TOPICS):
            flood.send(b"\1%06d" % number + b"x" * 944)
        flood.connect(publications_of(hub.address))
        for times in range(1, 4):
            refused("subscriptions", by=times)
            flood.poll(0)  # so that libzmq says all of it again where it connected again
    assert _peak_mb(hub.process.pid) - before < _MOST_MORE_MB
    while other.socket.poll(0):
        other.socket.recv_multipart()
    assert other.socket.poll(LIMIT_MS)  # it goes on


def test_previews_are_asked_for_as_long_as_somebody_watches(hub, connect):
    """Once they ended for all by one word, or never, after a topic named three times."""
    def asked():
        """Wait for the hub to ask, and give nothing: it asks again a heartbeat later."""
        return bool(sensor.receive("take_preview"))

    def left_alone():
        while sensor.socket.poll(0):
            sensor.socket.recv_multipart()
        return sensor.silent(round(5000 * 0.2 * PATIENCE))  # five heartbeats

    sensor = connect(*as_role(hub, "sensor"))
    sensor.send(messages.SensorReady(name="s", source="x"))
    publications = Path(publications_of(hub.local).removeprefix("ipc://"))
    greedy, watcher, foe = (RawSubscriber(publications, LIMIT_S) for _ in range(3))
    for _ in range(3):
        greedy.send(b"\1preview")
    assert asked()
    watcher.send(b"\1preview")
    foe.send(b"\1status")
    for _ in range(5):
        foe.send(b"\0preview")
    assert foe.socket.recv(1)  # a status, after all that it said
    greedy.close()
    for _ in range(5):
        assert asked()
    watcher.close()
    until(left_alone)
    foe.close()
    leave(hub, sensor)


def _peak_mb(process: int) -> int:
    status = Path(f"/proc/{process}/status").read_text()
    return next(int(line.split()[1]) // 1024 for line in status.splitlines()
                if line.startswith("VmHWM"))
