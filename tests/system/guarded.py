"""A guarded hub as a real process, a key for each role, and peers that send anything."""

import contextlib
import itertools
import os
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import zmq
from zmq.utils.monitor import parse_monitor_message

from denseface.service.client import Client
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage, BaseRequest
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.roles import Role
from denseface.service.protocol.wire import Packet, decode_from_hub, encode
from denseface.service.security import KeyPair, allow, new_pair, read_pair, read_public
from denseface.service.transport.addresses import publications_of
from tests.nursery import Forked
from tests.ports import free_port
from tests.system.running import REPOSITORY
from tests.unit.service.faces import small_face, small_frame
from tests.waiting import LIMIT_MS, LIMIT_S, PATIENCE, until

_PACE = {"DENSEFACE_HEARTBEAT_S": f"{0.2 * PATIENCE:g}", "DENSEFACE_LIVENESS": "100"}
"""The peers here send no heartbeats: none is to count as gone before its test is through."""


class Peer:
    """A connection with any key, which sends whatever a test has it send."""

    def __init__(
        self, address: str, pair: KeyPair | None = None, hub: str | None = None,
        kind: int = zmq.DEALER, *, password: str | None = None, routing_id: bytes | None = None,
    ) -> None:
        self.context = zmq.Context()
        self.socket = self.context.socket(kind)
        self.socket.linger = 0
        if pair and hub:
            self.socket.curve_serverkey = hub.encode()
            self.socket.curve_publickey = pair.public.encode()
            self.socket.curve_secretkey = pair.secret.encode()
        if routing_id:
            self.socket.set(zmq.ROUTING_ID, routing_id)
        if password:
            self.socket.plain_username, self.socket.plain_password = b"root", password.encode()
        if kind == zmq.SUB:
            address = publications_of(address)
        self.monitor = self.socket.get_monitor_socket()
        self.socket.connect(address)

    def send(self, message: BaseMessage, arrays=None) -> None:
        self.socket.send_multipart(encode(Packet(message, arrays or {})))

    def receive(self, kind: str) -> Packet:
        """Wait for a message of a kind."""
        for packet in self._received():
            if packet.message.kind == kind:
                return packet
        raise AssertionError(f"no {kind} came")

    def take(self) -> BaseMessage:
        """Wait for any message."""
        for packet in self._received():
            return packet.message
        raise AssertionError("no message came")

    def request(self, message: BaseRequest) -> BaseMessage:
        self.send(message)
        for packet in self._received():
            if getattr(packet.message, "request", None) == message.request:
                return packet.message
        raise AssertionError(f"no answer to {message.kind}")

    def _received(self) -> Iterator[Packet]:
        deadline = time.monotonic() + LIMIT_S
        while self.socket.poll(max(0, round(1000 * (deadline - time.monotonic())))):
            yield decode_from_hub(self.socket.recv_multipart())

    def status(self) -> messages.Status:
        answer = self.request(messages.GetStatus(request=99))
        assert isinstance(answer, messages.Status)
        return answer

    def poll_status(self) -> messages.Status:
        """Request repeatedly, as the connection may have been cut meanwhile."""
        for number in range(1000, 1050):
            self.send(messages.GetStatus(request=number))
            if self.socket.poll(500):
                packet = decode_from_hub(self.socket.recv_multipart())
                if isinstance(packet.message, messages.Status):
                    return packet.message
        raise AssertionError("no status came")

    def silent(self, milliseconds: int = 300) -> bool:
        """Say whether nothing comes."""
        return not self.socket.poll(milliseconds)

    def close(self) -> None:
        self.context.destroy(linger=0)


@dataclass
class GuardedHub:
    """A running `denseface hub` with a local and a guarded listener."""

    process: Forked
    local: str
    address: str
    keys: Path
    log: Path

    @property
    def hub_key(self) -> Path:
        return self.keys / "hub.public"

    def secret(self, name: str) -> Path:
        return self.keys / f"{name}.secret"

    def new_key(self, name: str, *roles: Role) -> KeyPair:
        """Make a key and, with roles, allow it and wait until the hub knows."""
        secret, public = new_pair(self.keys, name)
        if roles:
            allow(self.keys, name, read_public(public), frozenset(roles))
        return read_pair(secret)

    def peer(
        self, name: str, kind: int = zmq.DEALER, routing_id: bytes | None = None
    ) -> Peer:
        return Peer(self.address, read_pair(self.secret(name)), read_public(self.hub_key), kind,
                    routing_id=routing_id)

    def client(self, name: str) -> Client:
        return Client(self.address, key=self.secret(name), hub_key=self.hub_key)

    def status(self) -> messages.Status:
        with Client(self.local) as client:
            return client.status(timeout=LIMIT_S)

    def refused(self, reason: str) -> int:
        return self.status().refused.get(reason, 0)


@contextmanager
def guarded_hub(folder: Path, host: str = "127.0.0.1", port: int | None = None,
                code: str = "", **environment: str) -> Iterator[GuardedHub]:
    """Run a hub that has a key `hub` and for each role one of its name.

    Parameters
    ----------
    code : Python that runs in the hub's process before the hub does
    """
    keys = folder / "keys"
    new_pair(keys, "hub")
    for role in Role:
        _, public = new_pair(keys, role)
        allow(keys, role, read_public(public), frozenset({role}))
    with tempfile.TemporaryDirectory(prefix="df-") as short:
        local = f"ipc://{short}/hub"
        address = f"tcp://{host}:{port or free_port(host)}"
        log = folder / "hub.log"
        with log.open("w") as stderr:
            process = Forked(
                ["-c", f"import sys\n{code}\n"
                 "from denseface.service.cli import main\nsys.exit(main(sys.argv[1:]))",
                 "hub", "--address", local, "--listen", address, "--keys", str(keys),
                 "--data", str(folder / "data")],
                cwd=REPOSITORY, stderr=stderr, env=os.environ | _PACE | environment)
        hub = GuardedHub(process, local, address, keys, log)
        try:
            until(lambda: "listening" in log.read_text() or process.poll() is not None)
            yield hub
        finally:
            with contextlib.suppress(ProcessLookupError):
                process.terminate()
            try:
                process.wait(LIMIT_S)
            finally:
                process.kill()


FRAME, FRAME_ARRAYS = FrameHeader.of(small_frame())
FACE, FACE_ARRAYS = FaceHeader.of(small_face())


def press_through(hub: GuardedHub, capture_id: str) -> None:
    """Press with a key, be its sensor and its worker, and get the face."""
    sensor, worker, presser = (hub.peer(name) for name in ("sensor", "worker", "presser"))
    subscriber = hub.peer("subscriber", zmq.SUB)
    try:
        subscriber.socket.subscribe("faces")
        subscriber.socket.subscribe("status")
        assert subscriber.socket.poll(LIMIT_MS)  # the first status
        sensor.send(messages.SensorReady(name="s", source="x"))
        worker.send(messages.WorkerReady(name="w", credit=0))
        until(lambda: hub.status().ready)
        presser.send(messages.Press(request=1, capture_id=capture_id))
        sensor.receive("take")
        sensor.send(messages.Frame(capture_id=capture_id, frame=FRAME), FRAME_ARRAYS)
        presser.receive("press_accepted")
        for credit in itertools.count(1):
            job = worker.receive("job").message
            worker.send(messages.Result(
                capture_id=job.capture_id, settings_hash=job.settings_hash,
                frame_sha256=job.frame_sha256, face=FACE), FACE_ARRAYS)
            if job.capture_id == capture_id:
                break
            worker.send(messages.WorkerReady(name="w", credit=credit))
        assert presser.request(messages.GetFace(
            request=2, capture_id=capture_id, wait_s=10)).kind == "face_done"
        until(lambda: subscriber.socket.poll(LIMIT_MS)
              and subscriber.socket.recv_multipart()[0] == b"faces")
    finally:
        leave(hub, sensor, worker)
        for one in (sensor, worker, presser, subscriber):
            one.close()


def leave(hub: GuardedHub, *peers: Peer) -> None:
    """Have all sensors and workers say goodbye, and wait until the hub knows."""
    for one in peers:
        one.send(messages.Goodbye())
    until(lambda: not hub.status().sensors + hub.status().workers)


def happened(peer: Peer, *events: zmq.Event, within_ms: int = LIMIT_MS) -> bool:
    """Wait for one of some things to happen to a peer's connection."""
    while peer.monitor.poll(within_ms):
        if parse_monitor_message(peer.monitor.recv_multipart())["event"] in events:
            return True
    return False


def as_role(
    hub: GuardedHub, role: str, kind: int = zmq.DEALER
) -> tuple[str, KeyPair, str, int]:
    """Give what opens a connection with the key of a role."""
    return (hub.address, read_pair(hub.secret(role)), read_public(hub.hub_key), kind)


PRESS = messages.Press(request=1, capture_id="attack")
