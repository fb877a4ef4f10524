"""Keys that are revoked while in use, and keys that send what their role does not allow.

The second half of the attacks in `docs/reliability.md`.
"""

import threading
from contextlib import suppress

import pytest
import zmq

from denseface.service.client import Operator
from denseface.service.errors import ClientTimeoutError, KeyRefusedError
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseRequest
from denseface.service.protocol.roles import Role
from denseface.service.protocol.wire import Packet, encode
from denseface.service.security import revoke
from tests.system.guarded import (
    FACE,
    FACE_ARRAYS,
    FRAME,
    FRAME_ARRAYS,
    PRESS,
    as_role,
    happened,
    leave,
)
from tests.waiting import LIMIT_MS, LIMIT_S, until

# --- revoked while connected

def test_a_revoked_worker_s_job_goes_to_another(hub, connect, refused):
    hub.new_key("evil", Role.WORKER)
    sensor, presser = connect(*as_role(hub, "sensor")), connect(*as_role(hub, "presser"))
    evil, good = connect(*as_role(hub, "evil")), connect(*as_role(hub, "worker"))
    sensor.send(messages.SensorReady(name="s", source="x"))
    evil.send(messages.WorkerReady(name="evil", credit=0))
    until(lambda: hub.status().ready)
    presser.send(messages.Press(request=1, capture_id="kept"))
    sensor.receive("take")
    sensor.send(messages.Frame(capture_id="kept", frame=FRAME), FRAME_ARRAYS)
    job = evil.receive("job").message
    revoke(hub.keys, "evil")
    until(lambda: not hub.status().workers)
    assert hub.status().queued == 1
    evil.send(messages.Result(capture_id="kept", settings_hash=job.settings_hash,
                             frame_sha256=job.frame_sha256, face=FACE), FACE_ARRAYS)
    evil.send(messages.WorkerReady(name="evil", credit=1))
    refused("revoked key", by=2)
    assert evil.silent()
    assert (hub.status().queued, hub.status().workers) == (1, ())
    good.send(messages.WorkerReady(name="good", credit=0))
    job = good.receive("job").message
    assert (job.capture_id, job.attempt) == ("kept", 2)
    good.send(messages.Result(capture_id="kept", settings_hash=job.settings_hash,
                             frame_sha256=job.frame_sha256, face=FACE), FACE_ARRAYS)
    until(lambda: hub.status().queued + hub.status().working == 0)
    # Sent again, it has no effect.
    good.send(messages.Result(capture_id="kept", settings_hash=job.settings_hash,
                             frame_sha256=job.frame_sha256, face=FACE), FACE_ARRAYS)
    good.send(messages.WorkerReady(name="good", credit=0))
    refused("replayed", by=2)
    leave(hub, sensor, good)


def test_a_revoked_key_that_floods_is_cut_off(hub, connect, refused):
    hub.new_key("flood", Role.WORKER)
    flood, other = connect(*as_role(hub, "flood")), connect(*as_role(hub, "worker"))
    assert flood.status()
    assert other.status()
    revoke(hub.keys, "flood")
    heartbeat = encode(Packet(messages.Heartbeat()))
    with suppress(zmq.Again):
        for _ in range(100_000):
            flood.socket.send_multipart(heartbeat, zmq.DONTWAIT)
    assert happened(flood, zmq.Event.HANDSHAKE_FAILED_AUTH)
    refused("revoked key", by=100)
    assert other.poll_status()


def test_a_revoked_presser_presses_no_more(hub, refused):
    hub.new_key("leaver", Role.PRESSER)
    with hub.client("leaver") as client:
        assert client.status(timeout=LIMIT_S)
        revoke(hub.keys, "leaver")
        until(lambda: hub.log.read_text() and _unanswered(client))
        with pytest.raises(ClientTimeoutError, match="revoked"):
            client.press("attack", timeout=1)
    refused("revoked key")


def _unanswered(client):
    try:
        client.status(timeout=1)
    except ClientTimeoutError:
        return True
    return False


def test_a_revoked_subscriber_receives_no_more_and_the_others_do(hub, connect, refused):
    hub.new_key("spy", Role.SUBSCRIBER)
    spy, other = (connect(*as_role(hub, name, zmq.SUB)) for name in ("spy", "subscriber"))
    for one in (spy, other):
        one.socket.subscribe("status")
        assert one.socket.poll(LIMIT_MS)
    revoke(hub.keys, "spy")
    assert happened(spy, zmq.Event.DISCONNECTED)
    assert happened(spy, zmq.Event.HANDSHAKE_FAILED_AUTH)
    refused("unknown key")
    while spy.socket.poll(0):
        spy.socket.recv_multipart()
    while other.socket.poll(0):
        other.socket.recv_multipart()
    for _ in range(3):
        assert other.socket.poll(LIMIT_MS)
        other.socket.recv_multipart()
    assert spy.silent(0)


def test_a_client_that_follows_is_told(hub):
    hub.new_key("reader", Role.SUBSCRIBER)
    with hub.client("reader") as client:
        after = client.status(timeout=LIMIT_S).sequence
        revoked = threading.Timer(0.5, revoke, (hub.keys, "reader"))
        revoked.start()
        with pytest.raises(KeyRefusedError, match="revoked"):
            next(client.published(after=after, timeout=LIMIT_S))
        revoked.join()


# --- the wrong role

ROLES = [
    ("subscriber", PRESS),
    ("worker", PRESS),
    ("sensor", PRESS),
    ("operator", PRESS),
    ("worker", messages.GetFace(request=1, capture_id="first")),
    ("sensor", messages.GetFace(request=1, capture_id="first")),
    ("operator", messages.GetFace(request=1, capture_id="first")),
    ("worker", messages.GetNext(request=1, after=0)),
    ("presser", messages.GetNext(request=1, after=0)),
    ("presser", messages.GetFace(request=1, capture_id="foreign")),
    ("presser", messages.Purge(request=1, everything=True)),
    ("subscriber", messages.Purge(request=1, everything=True)),
    ("worker", messages.DropDead(request=1, capture_id="first")),
    ("presser", messages.SensorReady(name="evil", source="x")),
    ("worker", messages.SensorReady(name="evil", source="x")),
    ("subscriber", messages.WorkerReady(name="evil", credit=0)),
    ("sensor", messages.WorkerReady(name="evil", credit=0)),
    ("presser", messages.Goodbye()),
]


@pytest.mark.parametrize(("role", "message"), ROLES, ids=[f"{a}-{b.kind}" for a, b in ROLES])
def test_the_wrong_role_is_told_so(hub, connect, refused, role, message):
    if message.kind == "get_face" and message.capture_id == "foreign":
        _foreign(hub, connect)
    peer = connect(*as_role(hub, role))
    peer.send(message)
    kind = "request_failed" if isinstance(message, BaseRequest) else "denied"
    said = peer.receive(kind).message.message
    assert said.startswith(f"refused: {message.kind} needs the role ")
    assert said.endswith(f"the key {role} has {role}")
    refused("role")
    status = hub.status()
    assert "evil" not in status.sensors + status.workers
    with Operator(hub.local) as operator:
        operator.purge(capture_id="foreign")


@pytest.mark.parametrize(("role", "message", "arrays"), [
    ("worker", messages.Frame(capture_id="attack", frame=FRAME), FRAME_ARRAYS),
    ("presser", messages.Frame(capture_id="attack", frame=FRAME), FRAME_ARRAYS),
    ("sensor", messages.Result(capture_id="first", settings_hash="0", frame_sha256="0" * 64,
                               face=FACE), FACE_ARRAYS),
    ("subscriber", messages.Result(capture_id="first", settings_hash="0", frame_sha256="0" * 64,
                                   face=FACE), FACE_ARRAYS),
])
def test_frames_and_faces_come_from_their_makers(hub, connect, refused, role, message, arrays):
    peer = connect(*as_role(hub, role))
    peer.send(message, arrays)
    assert "needs the role" in peer.receive("denied").message.message
    refused("role")


def _foreign(hub, connect):
    """Have another key press and accept that capture."""
    hub.new_key("somebody", Role.PRESSER)
    sensor, presser = connect(*as_role(hub, "sensor")), connect(*as_role(hub, "somebody"))
    sensor.send(messages.SensorReady(name="s", source="x"))
    until(lambda: hub.status().sensors)
    presser.send(messages.Press(request=1, capture_id="foreign"))
    sensor.receive("take")
    sensor.send(messages.Frame(capture_id="foreign", frame=FRAME), FRAME_ARRAYS)
    presser.receive("press_accepted")
    pending = presser.request(messages.GetFace(request=2, capture_id="foreign"))
    assert pending.kind == "capture_pending"
    leave(hub, sensor)


@pytest.mark.parametrize("role", ["worker", "sensor", "presser", "operator"])
def test_only_a_subscriber_may_connect_to_the_topics(hub, connect, refused, role):
    peer = connect(*as_role(hub, role, zmq.SUB))
    peer.socket.subscribe("")
    assert happened(peer, zmq.Event.HANDSHAKE_FAILED_AUTH)
    refused("role")
    assert peer.silent(0)


def test_other_topics_are_nobody_s(hub, connect, refused):
    peer = connect(*as_role(hub, "subscriber", zmq.SUB))
    peer.socket.subscribe("")
    peer.socket.subscribe("f")
    refused("malformed", by=2)
    assert peer.silent(600)
