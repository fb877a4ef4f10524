"""Peers with good keys that lie, and a disk that hangs, against a real hub."""

import json
import threading
from contextlib import closing, contextmanager

import pytest
import zmq

from denseface.service.protocol import messages
from tests.system.guarded import FRAME, FRAME_ARRAYS, guarded_hub
from tests.waiting import LIMIT_MS, PATIENCE, until

_HEARTBEAT_S = 0.1 * PATIENCE


@contextmanager
def says_for_ever(socket: zmq.Socket[bytes], message: dict[str, object]):
    """Send a message at every heartbeat, until the end of the block."""
    leave = threading.Event()

    def run() -> None:
        while not leave.wait(_HEARTBEAT_S):
            socket.send(json.dumps(message).encode())

    thread = threading.Thread(target=run)
    thread.start()
    try:
        yield
    finally:
        leave.set()
        thread.join()


@pytest.fixture
def hub(tmp_path):
    with guarded_hub(
            tmp_path, DENSEFACE_JOB_TIMEOUT_S=f"{PATIENCE:g}", DENSEFACE_ATTEMPTS="1",
            DENSEFACE_HEARTBEAT_S=f"{_HEARTBEAT_S:g}", DENSEFACE_LIVENESS="100") as hub:
        yield hub


def test_a_worker_that_holds_its_job_for_ever_loses_it(hub):
    context = zmq.Context()
    liar = context.socket(zmq.DEALER)
    with closing(hub.peer("sensor")) as sensor, closing(hub.peer("presser")) as presser:
        try:
            liar.connect(hub.local)
            liar.send(json.dumps({
                "kind": "worker_ready", "version": 2, "name": "liar", "credit": 0}).encode())
            sensor.send(messages.SensorReady(name="s", source="x"))
            until(lambda: hub.status().ready)
            presser.send(messages.Press(request=1, capture_id="a"))
            sensor.receive("take")
            sensor.send(messages.Frame(capture_id="a", frame=FRAME), FRAME_ARRAYS)
            presser.receive("press_accepted")
            assert liar.poll(LIMIT_MS)
            assert json.loads(liar.recv_multipart()[0])["kind"] == "job"
            with says_for_ever(liar, {"kind": "heartbeat", "version": 2, "holding": "a"}):
                until(lambda: hub.status().dead)
            assert hub.status().since_start["overdue"] == 1
            until(lambda: "JobOverdue" in hub.log.read_text())
        finally:
            context.destroy(linger=0)


def test_nobody_waits_for_a_disk_that_hangs(tmp_path):
    with guarded_hub(tmp_path, DENSEFACE_FAILPOINTS="hub.frame.written=hang",
                     DENSEFACE_TAKE_TIMEOUT_S=f"{5 * PATIENCE:g}") as hub, \
            closing(hub.peer("sensor")) as sensor, closing(hub.peer("presser")) as presser, \
            closing(hub.peer("operator")) as operator:
        try:
            sensor.send(messages.SensorReady(name="s", source="x"))
            until(lambda: hub.status().sensors)
            presser.send(messages.Press(request=1, capture_id="a"))
            sensor.receive("take")
            sensor.send(messages.Frame(capture_id="a", frame=FRAME), FRAME_ARRAYS)
            said = presser.receive("request_failed").message
            assert said.request == 1
            assert "is not known" in said.message
            again = presser.request(messages.Press(request=2, capture_id="a"))
            assert again.message == said.message
            assert presser.request(messages.Press(request=3, capture_id="b")).reason == "disk"
            purge = operator.request(messages.Purge(request=4, everything=True))
            assert "nothing was removed" in purge.message
            assert hub.status().pressed == 1
        finally:
            hub.process.kill()  # told to stop, it would wait for what it writes
