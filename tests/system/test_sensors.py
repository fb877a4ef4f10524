"""Several sensors at one hub, as a program sees them that has nothing but ZeroMQ and JSON."""

import json
import tempfile
import threading
import time
from contextlib import closing, contextmanager

import numpy as np
import pytest
import zmq

from denseface.service.client import Client
from denseface.service.errors import PressRefusedError
from denseface.service.protocol.jpeg import jpeg_size
from tests.system.running import RECORDINGS, hub_alone, service
from tests.unit.service.faces import jpeg
from tests.waiting import LIMIT_MS, LIMIT_S, until

PICTURE = jpeg(640, 480)
HINT = {"timestamp_us": 7, "codes": ["come_closer"], "text": "come closer",
        "measures": {"distance_mm": 1400.0}}


class RawSensor:
    """A capture process that is none: no frames, but previews and hints as they are asked for."""

    def __init__(self, address, name, state="streaming", reason=""):
        self.name, self.state, self.reason = name, state, reason
        self.heard = []
        self.unasked = 0
        """Times that it said its state since it was last asked for anything."""
        self._stop = threading.Event()
        self._context = zmq.Context()
        self._thread = threading.Thread(target=self._run, args=[address])
        self._thread.start()

    def close(self):
        self._stop.set()
        self._thread.join()
        self._context.destroy(linger=0)

    def takes(self):
        return [one for one in self.heard if one["kind"] == "take"]

    def _run(self, address):
        with self._context.socket(zmq.DEALER) as socket:
            socket.connect(address)
            self._serve(socket)

    def _serve(self, socket):
        def say(kind, *arrays, **fields):
            header = {"kind": kind, "version": 2} | fields
            socket.send_multipart([json.dumps(header).encode(), *arrays])

        last = 0.0
        while not self._stop.is_set():
            if time.monotonic() - last > 0.2:
                last = time.monotonic()
                self.unasked += 1
                say("sensor_state", name=self.name, state=self.state, reason=self.reason,
                    identity=f"serial {self.name}", figures={"frames": 9, "drops": 2})
            if not socket.poll(50):
                continue
            message = json.loads(socket.recv_multipart()[0])
            self.heard.append(message)
            self.unasked = 0
            match message["kind"]:
                case "take_preview":
                    say("preview_frame", PICTURE, preview={
                        "width": 640, "height": 480, "timestamp_us": time.monotonic_ns() // 1000,
                        "encoding": "jpeg", "jpeg_bytes": len(PICTURE), "hint": HINT,
                        "arrays": [{"name": "jpeg", "dtype": "|u1", "shape": [len(PICTURE)]}]})
                case "take_hints":
                    say("quality_hint", hint=HINT)
                case "take":
                    say("frame_failed", capture_id=message["capture_id"], message="come closer",
                        reason="quality", hint=HINT)


@contextmanager
def hub(tmp_path):
    with tempfile.TemporaryDirectory(prefix="df-") as folder:
        address = f"ipc://{folder}/hub"
        with hub_alone(address, tmp_path / "data"):
            yield address


@pytest.fixture
def address(tmp_path):
    with hub(tmp_path) as address:
        yield address


@pytest.fixture
def lasting(tmp_path, monkeypatch):
    """A hub to which a sensor counts as gone 100 s after its last word."""
    monkeypatch.setenv("DENSEFACE_LIVENESS", "100")
    with hub(tmp_path) as address:
        yield address


@contextmanager
def raw(kind, address, topic=None):
    context = zmq.Context()
    try:
        with context.socket(kind) as socket:
            socket.linger, socket.rcvtimeo = 0, LIMIT_MS
            if topic is not None:
                socket.subscribe(topic)
            socket.connect(address)
            yield socket
    finally:
        context.destroy(linger=0)


def ask(socket, **fields):
    socket.send(json.dumps({"version": 2, "request": 1} | fields).encode())
    return json.loads(socket.recv_multipart()[0])


def known(client):
    return {one.name: one.state for one in client.status(timeout=LIMIT_S).sensor_states}


def test_a_press_goes_to_the_sensor_of_its_name_and_hears_what_to_do(lasting):
    with closing(RawSensor(lasting, "left")) as left, Client(lasting) as client, \
            closing(RawSensor(lasting, "right")) as right:
        until(lambda: known(client) == dict.fromkeys(("left", "right"), "streaming"))
        with pytest.raises(PressRefusedError, match="come closer") as refused:
            client.press(sensor="right", gate="wait", gate_timeout=2, frames=3)
        assert (refused.value.reason, refused.value.codes) == ("quality", ("come_closer",))
        (take,) = right.takes()
        assert (take["gate"], take["gate_timeout"], take["frames"]) == ("wait", 2, 3)
        assert left.takes() == []
        one = client.status(timeout=LIMIT_S).sensor_states[0]
        assert (one.identity, one.figures.drops) == (f"serial {one.name}", 2)


def test_a_press_for_a_sensor_that_is_not_there_hears_which_are(address):
    with closing(RawSensor(address, "left")), Client(address) as client:
        until(lambda: known(client))
        with pytest.raises(PressRefusedError, match="no sensor middle is connected; there: left"):
            client.press(sensor="middle")


def test_a_press_hears_at_once_why_there_is_no_frame(address):
    with closing(RawSensor(address, "kinect", "blocked", "no permission for /dev/bus/usb/1/4")), \
            Client(address) as client:
        until(lambda: known(client) == {"kinect": "blocked"})
        assert not client.status(timeout=LIMIT_S).ready
        with pytest.raises(PressRefusedError) as refused:
            client.press()
        assert refused.value.reason == "no_sensor"
        assert "the sensor kinect is blocked: no permission for /dev/bus/usb/1/4" in str(
            refused.value)


def test_what_an_older_client_says_is_taken_and_answered(lasting):
    with closing(RawSensor(lasting, "s")) as sensor, raw(zmq.DEALER, lasting) as socket, \
            Client(lasting) as client:
        until(lambda: client.status(timeout=LIMIT_S).sensors)
        answer = ask(socket, kind="press", capture_id="a")
        assert (answer["kind"], answer["reason"]) == ("press_refused", "quality")
        (take,) = sensor.takes()
        assert take == {"version": 2, "kind": "take", "capture_id": "a"}  # as an older one reads it
        assert ask(socket, kind="get_status")["sensors"] == ["s"]


def test_previews_are_jpegs_and_hints_are_small(address):
    publications = f"{address}.publications"
    with closing(RawSensor(address, "s")) as sensor, \
            raw(zmq.SUB, publications, b"preview") as previews:
        topic, header, picture = previews.recv_multipart()
        shown = json.loads(header)["preview"]
        assert (topic, shown["sensor"], shown["encoding"]) == (b"preview", "s", "jpeg")
        assert (shown["hint"]["text"], len(picture)) == ("come closer", shown["jpeg_bytes"])
        assert jpeg_size(picture) == (640, 480) == (shown["width"], shown["height"])
        assert all(one["kind"] != "take_hints" for one in sensor.heard)
        with raw(zmq.SUB, publications, b"hints") as hints:
            topic, header = hints.recv_multipart()
        assert len(header) < 1000
        said = json.loads(header)
        assert (topic, said["sensor"], said["hint"]) == (b"hints", "s", HINT)
        asked = [one["kind"] for one in sensor.heard]
        assert {*asked} == {"take_preview", "take_hints"}


def test_nothing_is_asked_for_while_nobody_looks(address):
    with closing(RawSensor(address, "s")) as sensor, Client(address) as client:
        until(lambda: client.status(timeout=LIMIT_S).sensors)
        with closing(client.hints(timeout=LIMIT_S)) as hints:
            assert next(hints).text == "come closer"
        with closing(client.previews(timeout=LIMIT_S)) as previews:
            assert next(previews).hint.text == "come closer"
        until(lambda: sensor.unasked >= 5)


def test_up_serves_several_sources_each_by_a_process_of_its_own(tmp_path):
    one, other = RECORDINGS / "frontal_700.oni", RECORDINGS / "far_1000.oni"
    with service(one, tmp_path / "data", "--source", other) as up, up.client() as client:
        until(lambda: known(client) == {"frontal_700": "streaming", "far_1000": "streaming"})
        for name, (near, far) in {"frontal_700": (600, 800), "far_1000": (900, 1100)}.items():
            face = client.get(client.press(sensor=name))
            assert near < np.median(face.initial.points[:, 2]) < far
            with closing(client.previews(sensor=name, timeout=LIMIT_S)) as previews:
                shown = next(previews)
            assert (shown.sensor, shown.size, shown.image.shape) == (
                name, (640, 480), (480, 640, 3))
            assert jpeg_size(shown.jpeg) == shown.size
            assert len(shown.jpeg) < 100_000
            assert shown.image.std() > 20
        publications = f"{up.address}.publications"
        with raw(zmq.SUB, publications, b"preview") as previews:
            _, header, picture = previews.recv_multipart()
        shown = json.loads(header)["preview"]
        assert jpeg_size(picture) == (shown["width"], shown["height"]) == (640, 480)
        assert shown["hint"]["measures"]["faces"] == 1  # that of the very frame
        with raw(zmq.SUB, publications, b"hints") as hints:
            _, header = hints.recv_multipart()
        assert len(header) < 1000
        assert json.loads(header)["hint"]["measures"]["distance_mm"] > 500
        text = up.run("status").stdout
        assert "frontal_700 streaming" in text
        assert "far_1000 streaming" in text
        refused = up.run("press", "--sensor", "kinect")
        assert refused.returncode == 1
        assert refused.stderr.count("\n") == 1
        assert "there: far_1000, frontal_700" in refused.stderr
