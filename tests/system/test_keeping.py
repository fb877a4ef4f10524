"""What the hub keeps, through real processes: dead letters, removal, damage, a full disk."""

import json
import os
import subprocess
import sys
import threading
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

import psutil
import pytest
import zmq

from denseface.recon.settings import Settings
from denseface.service.client import Client, Operator
from denseface.service.errors import PressRefusedError, UnknownCaptureError
from denseface.service.hub import settings_hash
from denseface.service.protocol.messages import (
    Announce,
    Frame,
    FrameAccepted,
    Heartbeat,
    Result,
    SensorReady,
    Take,
)
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.wire import Packet, decode_from_hub, encode
from denseface.service.storage import FolderStore
from tests.system.running import (
    PATIENT,
    RECORDINGS,
    REPOSITORY,
    denseface,
    hub_alone,
    service,
    stopping,
)
from tests.unit.service.faces import small_face, small_frame
from tests.unit.service.storing import accept, finish
from tests.waiting import LIMIT_S, until

FRAME, FRAME_ARRAYS = FrameHeader.of(small_frame())
FACE, FACE_ARRAYS = FaceHeader.of(small_face())
HASH = settings_hash(Settings())


@pytest.fixture
def address(tmp_path_factory):
    folder = tmp_path_factory.mktemp("s")
    if len(str(folder)) > 80:
        pytest.skip(f"the temporary folder's path is too long for a socket: {folder}")
    return f"ipc://{folder}/hub"


def fill(data, *done):
    """Keep captures as a hub does that was stopped."""
    with FolderStore(data) as store:
        for name in done:
            accept(store, Packet(Frame(capture_id=name, frame=FRAME), FRAME_ARRAYS), Settings(),
                   HASH)
            finish(store, Packet(Result(
                capture_id=name, settings_hash=HASH, face=FACE,
                frame_sha256=store.find(name).frame_sha256), FACE_ARRAYS))


def files(data):
    return [path.name for folder in ("frames", "faces", "quarantine")
            for path in (data / folder).iterdir()]


@pytest.mark.timeout(300)  # a dozen commands one after the other
def test_an_operator_s_day(tmp_path):
    data = tmp_path / "data"
    once = {"DENSEFACE_ATTEMPTS": "1"} | stopping(data)
    with service(RECORDINGS / "frontal_700.oni", data, environment=once) as up, \
            up.client() as client:
        worker = up.stop_worker_amid_a_job()
        client.press("mishap")
        until(lambda: worker.status() == psutil.STATUS_STOPPED)
        worker.kill()
        until(lambda: client.status().dead == 1)
        (line,) = up.run("dead", "list").stdout.splitlines()
        assert line.startswith("1 mishap ")
        assert line.endswith("1 attempts: the worker that held it went away (WorkerLost)")
        retried = up.run("dead", "retry", "--all")
        assert (retried.returncode, retried.stdout) == (0, "mishap\n")
        assert client.get("mishap").report.capture_id == "mishap"
        assert up.run("dead", "list").stdout == ""
        assert up.run("dead", "drop", "mishap").returncode == 1

        before = datetime.now(UTC)
        client.get(client.press("second"))
        assert [next(client.published(last=2, timeout=LIMIT_S)).capture_id,
                next(client.published(since=before, timeout=LIMIT_S)).capture_id] == [
                    "mishap", "second"]
        listed = up.run("subscribe", "--since", before.isoformat(), "--count", "1")
        assert listed.stdout.startswith("3 second ")

        purged = up.run("purge", "--before", before.isoformat(), "--yes")
        assert (purged.returncode, purged.stdout) == (0, "1 capture removed\n")
        with pytest.raises(UnknownCaptureError):
            client.get("mishap")
        assert next(client.published(after=0, timeout=LIMIT_S)).capture_id == "second"
        assert up.run("purge", "--all", "--yes").stdout == "1 capture removed\n"
        assert files(up.data) == []
        assert client.status().sequence == 3


def test_the_hub_enforces_the_retention(tmp_path, address):
    fill(tmp_path / "data", "a", "b")
    with hub_alone(address, tmp_path / "data", "--retention", "1s") as log:
        until(lambda: files(tmp_path / "data") == [])
    assert "removed after the retention" in log.read_text()


def test_a_damaged_folder_is_mended_at_the_start(tmp_path, address):
    data = tmp_path / "data"
    fill(data, "a", "b")
    (data / "captures.sqlite3").write_bytes(b"no database" * 1000)
    (face,) = (data / "faces").glob("b.*")
    face.write_bytes(face.read_bytes()[:-100])
    with hub_alone(address, data) as log, Client(address) as client:
        assert client.get("a", timeout=LIMIT_S).report.dense_points == len(small_face().dense)
        assert next(client.published(after=0, timeout=LIMIT_S)).capture_id == "a"
        status = client.status()
        assert (status.queued, status.done) == (1, 1)
    assert "the database is made again" in log.read_text()
    reports = [json.loads(path.read_text()) for path in (data / "quarantine").glob("*.json")]
    assert sorted(Path(one["file"]).name.split(".")[0] for one in reports) == ["b", "captures"]


@contextmanager
def sensor(address):
    """A capture process that has a small frame for every press."""
    def run():
        with zmq.Context() as context, context.socket(zmq.DEALER) as dealer:
            dealer.linger = 0
            dealer.connect(address)
            ready = encode(Packet(SensorReady(name="s", source="x")))
            dealer.send_multipart(ready)
            while not stop.is_set():
                if not dealer.poll(200):
                    dealer.send_multipart(encode(Packet(Heartbeat())))
                    continue
                message = decode_from_hub(dealer.recv_multipart()).message
                if isinstance(message, Take):
                    dealer.send_multipart(encode(Packet(
                        Frame(capture_id=message.capture_id, frame=FRAME), FRAME_ARRAYS)))
                elif isinstance(message, Announce):
                    dealer.send_multipart(ready)
                elif isinstance(message, FrameAccepted):
                    accepted.append(message.capture_id)

    stop, accepted = threading.Event(), []
    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield accepted
    finally:
        stop.set()
        thread.join()


def write_for_ever(path):
    with path.open("wb", buffering=0) as file:
        while file.write(bytes(4096)):
            pass


def test_a_full_disk_refuses_presses_and_no_more(tmp_path, address):
    data = tmp_path / "small"
    data.mkdir()
    if subprocess.run(["unshare", "-m", "mount", "-t", "tmpfs", "none", data], check=False,
                      capture_output=True).returncode:
        pytest.skip("this user may not mount a small disk of its own")
    hub = subprocess.Popen(
        ["unshare", "-m", "sh", "-c",
         'mount -t tmpfs -o size=4m,mode=700 none "$1" && exec "$2" -m denseface hub --data "$1"'
         ' --address "$3"', "sh", data, sys.executable, address],
        cwd=REPOSITORY, env=os.environ | PATIENT | {"DENSEFACE_RESERVE_MIB": "0"})
    seen = Path(f"/proc/{hub.pid}/root") / data.relative_to("/")
    try:
        with sensor(address) as accepted, Operator(address) as client:
            until(lambda: client.status(timeout=LIMIT_S).sensors != ())
            client.press("before")
            with pytest.raises(OSError, match="No space left"):
                write_for_ever(seen / "other")
            with pytest.raises(PressRefusedError, match="no room on the disk"):
                client.press("refused")
            assert sorted(path.name for path in (seen / "frames").iterdir()) == ["before.frame"]
            assert client.status().queued == 1
            assert client.purge(capture_id="before") == 1
            (seen / "other").unlink()
            client.press("after")
            until(lambda: accepted == ["before", "after"])
    finally:
        hub.terminate()
        assert hub.wait(LIMIT_S) == 0


def test_purging_asks_first(address):
    asked = denseface("purge", "--all", "--address", address)
    assert (asked.returncode, asked.stderr.count("\n")) == (2, 1)
