import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from denseface.capture import Source, open_source
from denseface.capture.errors import CalibrationError, DriverError, UnreadableSourceError
from denseface.capture.live.sensor import open_sensor
from denseface.capture.npz import save_frame
from tests.unit import frames

ARGUMENT, BESIDE, OWN = (frames.calibration(color=frames.camera(f=f)) for f in (101., 102., 103.))


@pytest.fixture
def saved(tmp_path):
    path = tmp_path / "take.1.npz"
    save_frame(frames.frame(
        np.zeros((120, 160), np.uint16), np.zeros((120, 160, 3), np.uint8), OWN), path)
    return path


def opened(path, calibration=None):
    with open_source(path, calibration) as source:
        assert isinstance(source, Source)
        assert source.uri == str(path)
        (frame,) = source
    return frame.calibration.color.fx, frame.calibration_origin


def test_precedence_of_calibrations(saved):
    assert opened(saved) == (103, "npz file")
    beside = saved.with_name("take.1.calibration.json")
    beside.write_text(BESIDE.to_json())
    assert opened(saved) == (102, "beside: take.1.calibration.json")
    argument = saved.with_name("mine.json")
    argument.write_text(ARGUMENT.to_json())
    assert opened(saved, argument) == (101, "argument mine.json")
    assert opened(str(saved), str(argument)) == (101, "argument mine.json")
    assert opened(saved, ARGUMENT) == (101, "argument")


def test_a_calibration_that_wins_must_be_readable(saved):
    with pytest.raises(CalibrationError, match=r"none\.json: No such file"):
        open_source(saved, "none.json")
    saved.with_name("take.1.calibration.json").write_text("{")
    with pytest.raises(CalibrationError, match=r"take\.1\.calibration\.json"):
        open_source(saved)


@pytest.mark.parametrize("uri", ["", "face.png", "webcam:", "http://x/face.oni2", "npz"])
def test_unknown_kinds_are_named_with_those_accepted(uri):
    with pytest.raises(UnreadableSourceError) as caught:
        open_source(uri)
    assert str(caught.value).startswith(uri)
    assert str(caught.value).endswith(
        "not a known kind of source; accepted: NAME.npz, NAME.oni, a folder of .npz, "
        "a folder of image pairs, openni2: or openni2:URI")


@pytest.mark.parametrize("kind", ["npz", "oni", "ONI"])
def test_missing_files_and_folders(tmp_path, kind):
    with pytest.raises(UnreadableSourceError, match=rf"none\.{kind}: no such file"):
        open_source(tmp_path / f"none.{kind}")
    (tmp_path / f"dir.{kind}").mkdir()
    with pytest.raises(UnreadableSourceError, match=rf"dir\.{kind}: is a folder"):
        open_source(tmp_path / f"dir.{kind}")


@pytest.mark.parametrize("open_it", [open_source, open_sensor])
def test_a_source_whose_library_is_not_installed(open_it, monkeypatch):
    monkeypatch.setitem(sys.modules, "denseface.capture.openni2", None)
    with pytest.raises(DriverError, match=r"denseface\.capture\.openni2"):
        open_it("openni2:")


def test_importing_capture_is_light():
    code = ("import sys, denseface.capture; "
            "print([m for m in ('primesense', 'cv2', 'open3d', 'scipy') if m in sys.modules])")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_folder_of_frames_in_the_order_of_their_names(saved):
    folder = saved.parent / "take"
    folder.mkdir()
    for name, f in (("b.npz", 2), ("a.npz", 1), ("c.NPZ", 3)):
        (folder / name).write_bytes(saved.read_bytes())
        save_frame(frames.frame(
            np.full((120, 160), f, np.uint16), np.zeros((120, 160, 3), np.uint8), OWN),
            folder / name)
    (folder / "notes.txt").write_text("none")
    with open_source(folder) as source:
        assert (source.uri, source.frame_count) == (str(folder), 3)
        assert [int(frame.depth[0, 0]) for frame in source] == [1, 2, 3]
        assert {frame.calibration_origin for frame in source} == {"npz file"}
    folder.with_name("take.calibration.json").write_text(BESIDE.to_json())
    assert {frame.calibration_origin for frame in open_source(folder)} == {
        "beside: take.calibration.json"}


@pytest.mark.parametrize("said", [True, False])
def test_a_calibration_file_says_whether_depth_is_registered(saved, said):
    frame = next(iter(open_source(saved)))
    save_frame(replace(frame, registered=not said), saved)
    assert next(iter(open_source(saved, raw=True))).registered is not said
    beside = saved.with_name("take.1.calibration.json")
    beside.write_text(json.dumps(json.loads(OWN.to_json()) | {"registered": said}))
    assert next(iter(open_source(saved, raw=True))).registered is said
    beside.write_text(OWN.to_json())
    assert next(iter(open_source(saved, raw=True))).registered is not said


def test_a_calibration_file_that_says_it_otherwise(saved):
    beside = saved.with_name("take.1.calibration.json")
    beside.write_text(json.dumps(json.loads(OWN.to_json()) | {"registered": "yes"}))
    with pytest.raises(CalibrationError, match=r'registered: expected true or false, found "yes"'):
        open_source(saved)
