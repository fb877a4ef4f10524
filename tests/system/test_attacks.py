"""Everyone who may not connect: refused, counted, and the hub goes on to serve.

`docs/reliability.md` has the same rows as a table.
"""

import random
import re
import socket
from contextlib import ExitStack, suppress
from pathlib import Path

import psutil
import pytest
import zmq

from denseface.service.errors import KeyRefusedError
from denseface.service.protocol import messages
from denseface.service.protocol.payload import MAX_ARRAY_BYTES
from denseface.service.protocol.roles import Role
from denseface.service.protocol.wire import Packet, encode
from denseface.service.security import KeyPair, allow, new_pair, read_pair, read_public, revoke
from denseface.service.transport.addresses import publications_of
from tests.ports import free_port
from tests.system.guarded import (
    FACE,
    FACE_ARRAYS,
    FRAME,
    FRAME_ARRAYS,
    PRESS,
    as_role,
    guarded_hub,
    happened,
    press_through,
)
from tests.system.running import REPOSITORY, denseface
from tests.waiting import LIMIT_MS, LIMIT_S, until

# --- no way in without a hub key, an allowed key and an authenticator

def test_without_keys_the_hub_does_not_listen(tmp_path):
    keys, address = tmp_path / "keys", f"tcp://127.0.0.1:{free_port()}"
    hub = ("hub", "--address", f"ipc://{tmp_path}/h"[:90], "--listen", address, "--keys", keys,
           "--data", tmp_path / "data")
    for wrong, mend in (("no hub key", lambda: new_pair(keys, "hub")),
                        ("no key is allowed", lambda: (keys / "hub.secret").chmod(0o644)),
                        ("no key is allowed", lambda: allow(
                            keys, "a", KeyPair.generate().public, frozenset({Role.WORKER})))):
        done = denseface(*hub)
        assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
        assert address in done.stderr
        assert wrong in done.stderr
        mend()
    done = denseface(*hub)
    assert (done.returncode, len(done.stderr.splitlines())) == (2, 1)
    assert "mode 644" in done.stderr
    anywhere = denseface("hub", "--address", "tcp://0.0.0.0:5700", "--keys", tmp_path / "none",
                         "--data", tmp_path / "data")
    assert (anywhere.returncode, len(anywhere.stderr.splitlines())) == (2, 1)
    assert "CURVE" in anywhere.stderr


_STOPS = """
from pathlib import Path
from denseface.service.security.zap import Authenticator
answer = Authenticator.answer
def changed(self):
    if not Path({flag!r}).exists():
        answer(self)
    elif {closed}:
        self.socket.close()
    else:
        self.socket.recv_multipart()
Authenticator.answer = changed
"""


def test_when_the_authenticator_ends_nobody_connects_and_the_hub_ends(tmp_path, connect):
    flag = tmp_path / "stop"
    with guarded_hub(tmp_path, code=_STOPS.format(flag=str(flag), closed=True)) as hub:
        assert connect(*as_role(hub, "presser")).status()
        flag.touch()
        late = connect(*as_role(hub, "presser"))
        late.send(PRESS)
        assert hub.process.wait(LIMIT_S) == 1
        assert "authenticator has stopped" in hub.log.read_text().splitlines()[-1]
        assert "pressed" not in hub.log.read_text()
        assert late.silent()


def test_when_the_authenticator_is_silent_nobody_connects_and_the_rest_goes_on(tmp_path, connect):
    flag = tmp_path / "stop"
    with guarded_hub(tmp_path, code=_STOPS.format(flag=str(flag), closed=False)) as hub:
        before = connect(*as_role(hub, "presser"))
        assert before.status()
        flag.touch()
        late = connect(*as_role(hub, "presser"))
        late.send(messages.GetStatus(request=1))
        assert late.silent(2000)
        assert before.status()
        until(lambda: hub.refused("handshake") == 1)  # after 10 s it is hung up on
        flag.unlink()
        assert late.poll_status()


# --- keys

def test_an_unknown_key_is_refused(hub, connect, refused, tmp_path):
    peer = connect(hub.address, KeyPair.generate(), read_public(hub.hub_key))
    peer.send(PRESS)
    assert happened(peer, zmq.Event.HANDSHAKE_FAILED_AUTH)
    refused("unknown key")
    hub.new_key("stranger")
    with hub.client("stranger") as client, pytest.raises(KeyRefusedError, match="not allowed"):
        client.status()


def test_a_key_revoked_before_is_unknown(hub, refused):
    hub.new_key("former", Role.PRESSER)
    with hub.client("former") as client:
        assert client.status(timeout=LIMIT_S)
    revoke(hub.keys, "former")
    with hub.client("former") as client, pytest.raises(KeyRefusedError, match="revoked"):
        client.press()
    refused("unknown key")


@pytest.mark.parametrize("show", ["another hub's key", "no key", "a password"])
def test_another_mechanism_or_hub_is_refused(hub, connect, refused, show):
    if show == "another hub's key":
        peer = connect(hub.address, read_pair(hub.secret("presser")), KeyPair.generate().public)
    elif show == "no key":
        peer = connect(hub.address)
    else:
        peer = connect(hub.address, password="guess")  # noqa: S106
    peer.send(PRESS)
    assert happened(peer, zmq.Event.HANDSHAKE_FAILED_NO_DETAIL,
                    zmq.Event.HANDSHAKE_FAILED_PROTOCOL)
    refused("handshake")
    assert peer.silent()


def test_a_client_says_why_it_is_refused(hub):
    _, other = new_pair(hub.keys, "other-hub")
    status = ("status", "--hub", hub.address)
    keyless = denseface(*status)
    key = ("--key", hub.secret("subscriber"), "--hub-key")
    wrong = denseface(*status, *key, other)
    right = denseface(*status, *key, hub.hub_key)
    half = denseface(*status, *key[:2])
    assert [one.returncode for one in (keyless, wrong, right, half)] == [1, 1, 0, 2]
    assert all(len(one.stderr.splitlines()) == 1 for one in (keyless, wrong, half))
    assert "asks for a key" in keyless.stderr
    assert "--hub-key is not the key of the hub" in wrong.stderr
    assert "expected --hub-key" in half.stderr
    assert "refused" in right.stdout


# --- not ZeroMQ, not ours, too much

def test_garbage_is_hung_up_on(hub, refused):
    host, port = "127.0.0.1", int(hub.address.rpartition(":")[2])
    noise = random.Random(4)
    said = [b"GET / HTTP/1.1\r\nHost: x\r\n\r\n", noise.randbytes(70_000), b"\x16\x03\x01" * 50,
            b"\xff" + bytes(8) + b"\x7f\3\0CURVE" + bytes(15) + b"\0" * 32 + noise.randbytes(500),
            b"\xff" + bytes(8) + b"\x7f\3\0NULL" + bytes(16) + b"\0" * 32 + b"\4\x19\5READY"]
    for offset in (0, 1):
        for text in said:
            with socket.create_connection((host, port + offset), timeout=LIMIT_S) as raw:
                with suppress(OSError):  # it may be hung up on meanwhile
                    raw.sendall(text)
                    raw.shutdown(socket.SHUT_WR)
                _read_to_the_end(raw)
    refused("handshake", by=2 * len(said))


def test_a_slow_drip_is_hung_up_on(hub, refused):
    """Of many connections that dribble, all are ended in 10 s, and others connect meanwhile."""
    port = int(hub.address.rpartition(":")[2])
    drips = [socket.create_connection(("127.0.0.1", port), timeout=LIMIT_S) for _ in range(20)]
    for drip in drips:
        drip.sendall(b"\xff")
    with hub.client("presser") as client:
        assert client.status(timeout=LIMIT_S)
    for drip in drips:
        with drip:
            _read_to_the_end(drip)
    refused("handshake", by=len(drips))


def test_more_connections_than_the_hub_may_have_are_cut(tmp_path):
    """Whoever has no key at all can neither end the hub nor shut its own users out for long."""
    with (guarded_hub(tmp_path, DENSEFACE_CORE_DUMPS="1") as hub, zmq.Context() as context,
          ExitStack() as flood, context.socket(zmq.SUB) as beats):
        beats.subscribe("status")
        beats.connect(publications_of(hub.local))
        process = psutil.Process(hub.process.pid)
        process.rlimit(psutil.RLIMIT_NOFILE, (400, 400))
        port = int(hub.address.rpartition(":")[2])
        # Where there are none left between two looks, libzmq itself ends the process: the hub
        # has the system give it so many that nobody takes them as fast.
        for _ in range(16):
            for _ in range(40):
                with suppress(OSError):  # while the port is closed
                    drip = flood.enter_context(socket.create_connection(("127.0.0.1", port), 5))
                    drip.sendall(b"\xff")
            assert beats.poll(LIMIT_MS)
            while beats.poll(0):
                beats.recv_multipart()
        until(lambda: hub.refused("connections") >= 1)
        until(lambda: process.num_fds() < 60)  # the last of them cut, though still held open
        press_through(hub, "through")
        assert hub.process.poll() is None


def _read_to_the_end(raw):
    try:
        while raw.recv(4096):
            pass
    except ConnectionResetError:
        pass


def test_fuzzed_messages_of_an_accepted_key_are_counted(hub, connect, refused):
    noise = random.Random(4)
    good = [encode(Packet(messages.Result(capture_id="first", settings_hash="0",
                                          frame_sha256="0" * 64, face=FACE), FACE_ARRAYS)),
            encode(Packet(messages.WorkerReady(name="w", credit=0))),
            encode(Packet(messages.JobFailed(
                capture_id="first", settings_hash="0", frame_sha256="0" * 64, error="E",
                message="m", final=True)))]
    peer = connect(*as_role(hub, "worker"))
    before = sum(hub.status().refused.values())
    for _ in range(1000):
        parts = [bytes(part) for part in noise.choice(good)]
        where = noise.randrange(len(parts))
        match noise.randrange(5):
            case 0:
                parts[where] = parts[where][:noise.randrange(len(parts[where]))]
            case 1:
                parts[where] += noise.randbytes(noise.randrange(1, 50))
            case 2:
                parts.insert(where, noise.randbytes(noise.randrange(100)))
            case 3:
                parts[0] = noise.randbytes(noise.randrange(200))
            case 4:
                at = noise.randrange(len(parts[0]) - 1)
                parts[0] = parts[0][:at] + b"{[" + parts[0][at + 2:]
        peer.socket.send_multipart(parts)
    until(lambda: sum(hub.status().refused.values()) >= before + 1000)
    refused("malformed", by=100)
    refused("truncated", by=100)
    assert hub.status().workers == ()


def test_what_is_too_much_is_dropped(hub, connect, refused):
    peer = connect(*as_role(hub, "sensor"))
    ready = encode(Packet(messages.SensorReady(name="s", source="x")))
    peer.socket.send_multipart([*ready, *[b""] * 17])
    peer.socket.send_multipart([*ready, *[b"x"] * 100_000])
    peer.socket.send_multipart([b" " * 300_000 + ready[0]])
    peer.socket.send_multipart([b"x" * 30_000_000] * 5)
    refused("oversized", by=4)
    peer.socket.send_multipart([ready[0].replace(b'"version":2', b'"version":1')])
    peer.socket.send_multipart([ready[0].replace(b'"version":2,', b"").replace(
        b',"version":2', b"")])
    refused("version", by=2)
    peer.socket.send_multipart([ready[0], b"one array too many"])
    peer.socket.send_multipart([encode(Packet(messages.Frame(
        capture_id="attack", frame=FRAME), FRAME_ARRAYS))[0]])
    refused("truncated", by=2)
    assert hub.status().sensors == ()


def test_a_part_beyond_the_limit_ends_the_connection(hub, connect):
    peer = connect(*as_role(hub, "sensor"))
    assert peer.status()
    peer.socket.send(bytes(MAX_ARRAY_BYTES + 1))
    assert happened(peer, zmq.Event.DISCONNECTED)
    assert peer.poll_status()


def test_a_message_without_end_cannot_fill_the_memory(tmp_path, connect):
    with guarded_hub(tmp_path, DENSEFACE_MEMORY_MB="200") as hub:
        process = psutil.Process(hub.process.pid)
        peer = connect(*as_role(hub, "worker"))
        assert peer.status()
        for _ in range(1500):
            peer.socket.send(bytes(2**20), zmq.SNDMORE)
        peer.socket.send(b"")
        until(lambda: hub.refused("memory") >= 1)
        assert happened(peer, zmq.Event.DISCONNECTED)
        until(lambda: process.memory_info().rss < 200 * 2**20)
        press_through(hub, "after")
        # A tick may come late, so the limit of 200 MiB is passed by what comes meanwhile.
        assert 100 * 2**20 < _most_memory(process.pid) < 1000 * 2**20


def _most_memory(pid):
    """Give the most that a process has had at a time, bytes."""
    (peak,) = re.findall(r"^VmHWM:\s+(\d+) kB$", Path(f"/proc/{pid}/status").read_text(), re.M)
    return int(peak) * 1024


def test_another_user_of_the_machine_reads_nothing(hub):
    data = hub.log.parent / "data"
    found = [data, hub.keys, *data.rglob("*"), *hub.keys.rglob("*")]
    assert len([path for path in found if path.parent.name in ("frames", "faces")]) >= 2
    assert [path for path in found if path.stat().st_mode & 0o077] == []


def test_every_row_stands_in_the_documentation():
    text = (REPOSITORY / "docs" / "reliability.md").read_text()
    shown = set(re.findall(r"`(test_\w+)`", text))
    here = {name for file in ("test_attacks.py", "test_revoked_and_roles.py") for name in
            re.findall(r"^def (test_\w+)", Path(__file__).with_name(file).read_text(), re.M)}
    assert here - shown == {"test_every_row_stands_in_the_documentation"}
