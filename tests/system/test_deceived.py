"""Peers with good keys that lie, against a real hub."""

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
            DENSEFACE_HEARTBEAT_S=f"{_HEARTBEAT_S:g}", DENSEFACE_LIVENESS="50") as hub:
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
            assert "JobOverdue" in hub.log.read_text()
        finally:
            context.destroy(linger=0)
