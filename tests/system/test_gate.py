"""The gate in the service: hints, refusals, and the frame that was good enough."""

import subprocess
import sys
import threading
from contextlib import closing, contextmanager, suppress

import pytest

from denseface.capture import open_source
from denseface.service.client import Client
from denseface.service.errors import PressRefusedError
from tests.system.running import RECORDINGS, REPOSITORY, hub_alone, service
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.control import Control
from tests.virtual_sensor.process import environment, record_clip
from tests.waiting import LIMIT_S, until

STEP_IN = "step in front of the camera"


def images(name):
    """The depth and colour images of a recording."""
    with open_source(RECORDINGS / f"{name}.oni") as source:
        return [(frame.depth.copy(), frame.rgb.copy()) for frame in source]


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """Nobody for a second, then somebody who stands still for another, over and over."""
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, [*images("empty_room") * 10, *images("frontal_700") * 10])
    return path


@contextmanager
def capturing(source, tmp_path, *controls):
    """Run a hub and a capture process without a worker, and give a client."""
    address = f"ipc://{tmp_path}/h"
    with hub_alone(address, tmp_path / "data"), (tmp_path / "log").open("w") as stderr:
        process = subprocess.Popen(
            [sys.executable, "-m", "denseface", "capture", "--source", str(source), "--address",
             address], cwd=REPOSITORY, stderr=stderr, env=environment(controls=controls))
        try:
            with Client(address) as client:
                until(lambda: client.status(timeout=LIMIT_S).sensors)
                yield client
        finally:
            process.terminate()
            process.wait(LIMIT_S)


def refusal(client, **arguments):
    with pytest.raises(PressRefusedError) as caught:
        client.press(timeout=LIMIT_S, **arguments)
    return caught.value


def pressed(client):
    """Whether a press was accepted: the sensor streams."""
    with suppress(PressRefusedError):
        return bool(client.press(timeout=LIMIT_S))
    return False


def test_nobody_is_hinted_at_and_refused(tmp_path):
    with capturing(RECORDINGS / "empty_room.oni", tmp_path) as client:
        with closing(client.hints(timeout=LIMIT_S)) as hints:
            hint = next(hints)
        assert (hint.codes, hint.text, hint.ok) == (("nobody",), STEP_IN, False)
        assert hint.measures["faces"] == 0
        for arguments in ({"gate": "refuse"}, {"gate": "wait", "gate_timeout": 0.5},
                          {"gate": "best", "gate_timeout": 0.3}):
            refused = refusal(client, **arguments)
            assert refused.reason == "quality"
            assert STEP_IN in str(refused)
        with closing(client.previews(timeout=LIMIT_S)) as previews:
            assert next(previews).hint.codes == ("nobody",)
        client.press("off", timeout=LIMIT_S)


def test_of_a_recording_the_first_good_frame_is_taken(tmp_path):
    recording = tmp_path / "somebody_comes.oni"
    write_clip(tmp_path / "clip", [*images("empty_room") * 2, *images("frontal_700")])
    record_clip(tmp_path / "clip", recording, 9)
    with service(recording, tmp_path / "data") as up, up.client() as client:
        assert client.get(client.press(timeout=LIMIT_S, gate="wait", gate_timeout=LIMIT_S)
                          ).report.face_box[2] > 100


def test_of_a_live_sensor_a_good_frame_is_taken_and_pictures_carry_their_hints(clip, tmp_path):
    with (Control(tmp_path / "control", clip) as control,
          service("openni2:", tmp_path / "data",
                  environment=environment(controls=[control])) as up,
          up.client() as client):
        for index in range(2):
            # Of two seconds one is good.
            capture = client.press(f"p{index}", timeout=LIMIT_S, gate="wait", gate_timeout=LIMIT_S)
            report = client.get(capture).report
            assert report.face_box[2] > 100
            assert report.exposed_after_press_ms >= 0
        # Half of the window at least shows somebody; none of it is from before the press.
        for index in range(2):
            capture = client.press(f"b{index}", timeout=LIMIT_S, gate="best", gate_timeout=1.5)
            report = client.get(capture).report
            assert report.face_box[2] > 100
            assert report.exposed_after_press_ms >= 0
        seen = set()
        with closing(client.previews(timeout=LIMIT_S)) as previews:
            for picture in previews:
                if picture.hint is None:
                    continue
                # Of the frame that is shown, unless judging it took longer than a mirror may lag.
                late_us = picture.timestamp_us - picture.hint.timestamp_us
                assert -20_000 < late_us < 2_020_000
                seen.add("face" if "distance_mm" in picture.hint.measures else "nobody")
                if len(seen) == 2:
                    break
        with closing(client.hints(timeout=LIMIT_S)) as hints:
            assert any(hint.measures.get("distance_mm") for hint in hints)


def test_presses_without_a_gate_do_not_wait_for_one_with_it(clip, tmp_path):
    empty = tmp_path / "empty"
    write_clip(empty, images("empty_room"))
    with (Control(tmp_path / "control", empty) as control,
          capturing("openni2:", tmp_path, control) as client):
        until(lambda: pressed(client))
        found = []

        def wait():
            with Client(f"ipc://{tmp_path}/h") as other:
                found.append(refusal(other, capture_id="w", gate="wait", gate_timeout=2))

        waiting = threading.Thread(target=wait)
        waiting.start()
        for _ in range(3):
            client.press(timeout=LIMIT_S)
        waiting.join(LIMIT_S)
        assert [one.reason for one in found] == ["quality"]
        assert refusal(client, gate="refuse").reason == "quality"
