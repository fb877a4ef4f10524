"""Real processes, real sockets, real recordings through OpenNI2."""

import itertools
import json
import os
import signal
import socket
import threading

import numpy as np
import psutil
import pytest

from denseface.service.client import Client, PublishedFace, PublishedFailure
from denseface.service.errors import (
    CaptureFailedError,
    ClientTimeoutError,
    PressRefusedError,
    UnknownCaptureError,
)
from denseface.service.export import load_face
from tests.ports import free_port
from tests.system.running import (
    RECORDINGS,
    REPOSITORY,
    denseface,
    hub_alone,
    service,
    sockets,
    stopping,
)
from tests.system.snippets import SESSION, snippets
from tests.virtual_sensor.clip import write_clip
from tests.virtual_sensor.process import environment, play
from tests.waiting import LIMIT_S, until


@pytest.fixture(scope="module")
def running(tmp_path_factory):
    data = tmp_path_factory.mktemp("data") / "data"
    with service(RECORDINGS / "frontal_700.oni", data, environment=stopping(data)) as up:
        yield up


def test_a_press_gives_a_face_a_report_and_a_picture(running, tmp_path):
    done = running.run(
        "press", "--id", "demo", "--save", tmp_path / "face.npz", "--report",
        tmp_path / "report.json", "--preview", tmp_path / "face.png")
    assert (done.returncode, done.stdout) == (0, "demo\n")
    assert [line.partition(": ")[0] for line in done.stderr.splitlines()] == [
        str(tmp_path / name) for name in ("face.npz", "report.json", "face.png")]
    face = load_face(tmp_path / "face.npz")
    report = json.loads((tmp_path / "report.json").read_text())
    assert report["capture_id"] == "demo"
    assert report["dense_points"] == len(face.dense) > 8 * len(face.initial)
    assert (tmp_path / "face.png").read_bytes().startswith(b"\x89PNG")
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o600}
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "face.npz", "face.png", "report.json"]


def test_the_python_page_is_one_session(running, tmp_path, monkeypatch):
    """Each block of docs/python.md after the other, as somebody in a notebook runs them."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("DENSEFACE_ADDRESS", running.address)
    (tmp_path / "fixtures").symlink_to(REPOSITORY / "fixtures")
    session = {"__name__": "notebook"}
    for block in snippets(REPOSITORY / SESSION):
        assert block.language == "python"
        if not block.reason:
            code = "\n" * block.line + block.text
            exec(compile(code, SESSION, "exec"), session)  # noqa: S102
    assert repr(session["frame"]).startswith("<RgbdFrame: depth 640x480")
    assert len(session["again"].initial) == len(load_face("face.npz").initial)
    assert len(list((tmp_path / "faces").glob("*.ply"))) == 1


def test_the_same_id_again_is_the_same_capture(running):
    with running.client() as client:
        client.press("twice")
        first = client.get("twice")
        before = client.status().sequence
        assert client.press("twice") == "twice"
        second = client.get("twice")
        assert client.status().sequence == before
    np.testing.assert_array_equal(first.dense.points, second.dense.points)


def test_subscribers_get_every_face_in_order(running, tmp_path):
    found = []

    def follow():
        with running.client() as client:
            after = client.status().sequence
            started.set()
            for outcome in client.published(after=after, timeout=LIMIT_S):
                found.append(outcome)
                if len(found) == 3:
                    return

    started = threading.Event()
    thread = threading.Thread(target=follow)
    thread.start()
    assert started.wait(LIMIT_S)
    with running.client() as client:
        refused = client.status().refused
        pressed = [client.press() for _ in range(3)]
        thread.join(LIMIT_S)
        assert [outcome.capture_id for outcome in found] == pressed
        assert all(isinstance(outcome, PublishedFace) for outcome in found)
        assert [b.sequence - a.sequence for a, b in itertools.pairwise(found)] == [1, 1]
        assert client.status().refused == refused  # nothing in an ordinary day looks like an attack
        missed = client.published(after=found[0].sequence, timeout=LIMIT_S)
        assert [next(missed).capture_id, next(missed).capture_id] == pressed[1:]
    saved = running.run("subscribe", "--save", tmp_path, "--count", "1", "--mode", "640", "--after",
                        found[0].sequence - 1)
    assert saved.returncode == 0
    assert saved.stdout.startswith(f"{found[0].sequence} {pressed[0]} ")
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"{pressed[0]}.json", f"{pressed[0]}.ply"]
    assert {path.stat().st_mode & 0o777 for path in tmp_path.iterdir()} == {0o640}


def test_a_killed_worker_s_job_is_done_by_the_next(running):
    worker = running.stop_worker_amid_a_job()
    with running.client() as client:
        client.press("survivor")
        until(lambda: worker.status() == psutil.STATUS_STOPPED)
        worker.kill()
        assert client.get("survivor", timeout=LIMIT_S).report.capture_id == "survivor"


def test_a_hung_worker_s_job_is_done_by_another(running):
    worker = running.worker()
    worker.suspend()
    with running.client() as client:
        client.press("hung")
        with pytest.raises(ClientTimeoutError, match=r"hung: accepted, no face within 3 s"):
            client.get("hung", timeout=3)
        until(lambda: not client.status().workers)
        worker.resume()
        assert client.get("hung", timeout=LIMIT_S).report.capture_id == "hung"


def test_what_was_accepted_survives_a_killed_hub(running):
    (hub,) = [one for one in running.family() if "hub" in one.cmdline()]
    running.worker().suspend()
    with running.client() as client:
        client.press("kept")
        epoch = client.status().epoch
        hub.kill()
        hub.wait(LIMIT_S)
        client.press("at-once")  # a hub that is starting refuses nobody
        for one in running.family():
            if "worker" in one.cmdline():
                one.resume()
        assert client.get("kept", timeout=LIMIT_S).report.capture_id == "kept"
        assert client.status().epoch == epoch


def test_unknown_and_unfinished_captures_are_told_apart(running):
    with running.client() as client, pytest.raises(UnknownCaptureError, match="no such capture"):
        client.get("never-pressed")


def test_garbage_does_not_disturb_the_hub(running):
    path = running.address.removeprefix("ipc://")
    with socket.socket(socket.AF_UNIX) as raw:
        raw.connect(path)
        raw.sendall(os.urandom(4096))
    before = running.status()
    assert before.ready


def test_a_second_hub_on_the_same_address_is_refused(running, tmp_path):
    second = denseface("hub", "--address", running.address, "--data", tmp_path / "other")
    assert second.returncode == 1
    assert "another hub" in second.stderr.splitlines()[-1]
    assert running.status().ready


@pytest.mark.parametrize("stop", [signal.SIGTERM, signal.SIGINT])
def test_nothing_stays_after_a_stop(tmp_path, stop):
    with service(RECORDINGS / "empty_room.oni", tmp_path / "data") as up:
        family = up.family()
        assert [one.name() for one in family] == ["denseface"] * 4
        assert len(sockets(up)) == 2
        up.process.send_signal(stop)
        assert up.process.wait(LIMIT_S) == {signal.SIGTERM: 0, signal.SIGINT: 130}[stop]
        assert not [one for one in family if one.is_running()]
        assert sockets(up) == []
        assert "killed" not in up.log.read_text()


def test_the_children_of_a_killed_supervisor_end_by_themselves(tmp_path):
    with service(RECORDINGS / "empty_room.oni", tmp_path / "data") as up:
        children = up.family()[1:]
        up.process.kill()
        gone, alive = psutil.wait_procs(children, timeout=LIMIT_S)
        assert (len(gone), alive) == (3, [])
        assert sockets(up) == []


def test_a_frame_without_a_face_fails_the_capture(tmp_path):
    with service(RECORDINGS / "empty_room.oni", tmp_path / "data") as up:
        pressed = up.run("press", "--id", "room", "--save", tmp_path / "face.ply")
        assert pressed.returncode == 1
        assert pressed.stdout == "room\n"
        (line,) = pressed.stderr.splitlines()
        assert "NoFaceError" in line
        assert not (tmp_path / "face.ply").exists()
        with up.client() as client:
            outcome = next(client.published(after=0, timeout=LIMIT_S))
            assert isinstance(outcome, PublishedFailure)
            assert (outcome.capture_id, outcome.error.error) == ("room", "NoFaceError")
            with pytest.raises(CaptureFailedError):
                client.get("room")
            assert (client.status().failed, client.status().dead) == (1, 0)


def test_up_with_an_unreadable_source_ends_with_one_line(tmp_path):
    with service(tmp_path / "missing.oni", tmp_path / "data", ready=False) as up:
        assert up.process.wait(LIMIT_S) == 2
        # That it is being opened may have been logged before.
        lines = [line for line in up.log.read_text().splitlines() if "missing.oni" in line]
        assert [line for line in lines if "state=opening" not in line] == [
            f"denseface capture: {tmp_path / 'missing.oni'}: no such file"]
        assert sockets(up) == []


@pytest.mark.parametrize("folder", ["/dev/null", "/dev/null/data", "/proc/data"])
def test_up_with_an_impossible_data_folder_ends_at_once_with_one_line(folder, tmp_path):
    ended = denseface("up", "--data", folder, "--address", f"ipc://{tmp_path}/hub",
                      "--source", RECORDINGS / "frontal_700.oni")
    assert (ended.returncode, ended.stdout) == (2, "")
    (line,) = ended.stderr.splitlines()
    assert line.startswith(f"denseface up: {folder}: ")


def test_up_with_the_data_folder_of_another_ends_at_once(running, tmp_path):
    ended = denseface("up", "--data", running.data, "--address", f"ipc://{tmp_path}/hub",
                      "--source", RECORDINGS / "frontal_700.oni")
    assert ended.returncode == 1
    (line,) = ended.stderr.splitlines()
    assert "another hub has this data folder open" in line
    assert running.status().ready


def test_without_a_hub_the_client_says_so(tmp_path):
    address = f"ipc://{tmp_path}/none"[:90]
    with Client(address) as client, pytest.raises(ClientTimeoutError, match="denseface up"):
        client.status(timeout=0.3)
    status = denseface("status", "--wait", "0.3", "--address", address)
    assert status.returncode == 1
    assert len(status.stderr.splitlines()) == 1


def test_a_press_without_a_sensor_is_refused(tmp_path):
    address = f"tcp://127.0.0.1:{free_port()}"
    with hub_alone(address, tmp_path / "data"), Client(address) as client:
        with pytest.raises(PressRefusedError, match="no sensor"):
            client.press(timeout=LIMIT_S)
        assert not client.status().ready


@pytest.fixture(scope="module")
def clip(tmp_path_factory):
    """What the virtual sensor shows: a face."""
    frames, _ = play(RECORDINGS / "frontal_700.oni", max_frames=2)
    path = tmp_path_factory.mktemp("clip") / "clip"
    write_clip(path, [(frame.depth, frame.rgb) for frame in frames])
    return path


def test_a_live_sensor_gives_a_face_for_each_press(clip, tmp_path):
    with service("openni2:", tmp_path / "data", environment=environment(clip)) as up, \
            up.client() as client:
        faces = [client.get(client.press()) for _ in range(2)]
        assert all(face.report.calibration.startswith("device:") for face in faces)
        assert all(len(face.initial) > 10_000 for face in faces)
