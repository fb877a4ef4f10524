import os
from pathlib import Path

import pytest

from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin
from denseface.capture.oni.recorded import Recorded
from denseface.capture.oni.records import DEPTH_NODE, IMAGE_NODE
from tests.system.running import RECORDINGS
from tests.virtual_sensor.edited import began_late, without_cropping

FIXTURES = sorted(RECORDINGS.glob("*.oni"))


@pytest.mark.parametrize("path", FIXTURES, ids=lambda path: path.stem)
def test_nothing_is_changed_about_a_good_recording(path):
    recorded = Recorded(path)
    assert recorded.pairs == 3
    assert recorded.notes == ()
    assert recorded.shift_us == {DEPTH_NODE: 0, IMAGE_NODE: 0}
    assert not recorded.in_pairs
    assert recorded.calibration is None
    assert recorded.meaning(DepthMeaning()) == DepthMeaning(1000, DepthRounding.CUT)
    assert recorded.origin(0, 2) == FrameOrigin(
        skew_known_by="record order", source=f"{path.name}#2")


def test_a_real_kinect():
    folder = Path(os.environ.get("DENSEFACE_SHARED")
                  or Path(__file__).resolve().parents[5] / "shared")
    path = folder / "recordings" / "kinect_v1_room_no_face.oni"
    if not path.is_file():
        pytest.skip(f"no real recording at hand ({path.name} in the folder `shared`)")
    recorded = Recorded(path)
    assert (recorded.pairs, recorded.notes) == (12, ())
    assert recorded.shift_us == {DEPTH_NODE: 0, IMAGE_NODE: 0}
    assert recorded.origin(0, 0) == FrameOrigin(
        "SensorKinect", skew_known_by="stamps", source="kinect_v1_room_no_face.oni#0")


@pytest.mark.parametrize(("node", "other"), [(1, IMAGE_NODE), (2, DEPTH_NODE)])
def test_a_stream_that_began_late(tmp_path, node, other):
    path = tmp_path / "take.oni"
    path.write_bytes(began_late(FIXTURES[0].read_bytes(), node, 2))
    recorded = Recorded(path)
    assert recorded.shift_us[other] == 0
    assert sum(recorded.shift_us.values()) >= 33_000
    assert recorded.pairs == 1
    assert "began" in recorded.notes[0]


def test_a_recording_without_cropping(tmp_path):
    path = tmp_path / "take.oni"
    path.write_bytes(without_cropping(FIXTURES[0].read_bytes()))
    assert "lacks the Cropping property of the depth stream" in Recorded(path).notes[0]
