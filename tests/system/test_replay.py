"""Recordings as sources of the service, played by options."""

import pytest

from denseface.capture.npz import save_frame
from denseface.service.errors import PressRefusedError
from tests.system.running import RECORDINGS, denseface, service
from tests.virtual_sensor.process import play
from tests.waiting import LIMIT_S, until


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three frames of a face, a tenth of a second apart."""
    folder = tmp_path_factory.mktemp("frames") / "take"
    folder.mkdir()
    for number, frame in enumerate(play(RECORDINGS / "frontal_700.oni")[0]):
        save_frame(frame, folder / f"{number}.npz")
    return folder


def test_a_replay_in_real_time_is_a_live_sensor(folder, tmp_path):
    played, once = f"{folder}?rate=real", f"{folder}?rate=real&end=stop"
    with service(played, tmp_path / "data", "--source", once) as up, up.client() as client:
        until(lambda: {sensor.state for sensor in up.status().sensor_states} == {
            "streaming", "absent"})
        for _ in range(3):
            report = client.get(client.press(), timeout=LIMIT_S).report
            assert report.exposed_after_press_ms >= 0
            assert report.exposure_known_by == "stamps"
        # The second one played its three frames long ago.
        with pytest.raises(PressRefusedError, match="the recording is at its end"):
            client.press(sensor=once)


def test_live_ends_with_a_recording_that_is_played_once(folder):
    done = denseface("live", "--source", f"{folder}?end=stop", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert '"frames": 3,' in done.stdout


def test_one_frame_of_a_folder_is_reconstructed(folder, tmp_path):
    done = denseface("reconstruct", folder, "--frame", 1, "-o", tmp_path / "face.ply")
    assert done.returncode == 0, done.stderr
    done = denseface("reconstruct", f"{folder}?frame=1", "-o", tmp_path / "same.ply")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "face.ply").read_bytes() == (tmp_path / "same.ply").read_bytes()
