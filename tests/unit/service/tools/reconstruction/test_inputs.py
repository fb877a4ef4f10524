"""What there is to reconstruct in files and folders, and what each is called."""

from pathlib import Path

import numpy as np
import pytest

from denseface.service.errors import UsageError
from denseface.service.tools.reconstruction.inputs import find_inputs
from tests.unit.service.tools.reconstruction.conftest import write_frame


def found(folder, *given):
    """Names of what is found, and where it is below a folder."""
    return {one.name: str(Path(one.uri).relative_to(folder))
            for one in find_inputs([str(path) for path in given])}


def recording(path):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(b"NI10")
    return path


def test_a_folder_of_frames_is_one_source(take, tmp_path):
    assert found(tmp_path, take) == {"take": "take"}


def test_a_folder_of_recordings_stands_for_each_and_for_the_frames_beside_them(tmp_path):
    for name in ("b.oni", "a.oni", ".a.oni", "readme.txt", "a.calibration.json"):
        recording(tmp_path / "in" / name)
    write_frame(tmp_path / "in" / "c.npz")
    np.savez(tmp_path / "in" / "face.npz", points=np.zeros(3))
    (tmp_path / "in" / "damaged.npz").write_bytes(b"PK")
    assert found(tmp_path, tmp_path / "in") == {
        "a": "in/a.oni", "b": "in/b.oni", "c": "in/c.npz", "damaged": "in/damaged.npz"}


def test_a_folder_without_frames_stands_for_its_subfolders(take, tmp_path):
    recording(tmp_path / "more" / "deep" / "x.oni")
    (tmp_path / "more" / "back").symlink_to(tmp_path)
    (tmp_path / "notes").mkdir()
    (tmp_path / "pairs" / "depth").mkdir(parents=True)
    assert found(tmp_path, tmp_path) == {
        "x": "more/deep/x.oni", "pairs": "pairs", "take": "take"}


def test_what_would_be_called_the_same_is_not(tmp_path):
    for name in ("a/take.oni", "b/take.oni", "b/Take.oni", "c/take.npz", "c/take.oni", "c/b_take"):
        recording(tmp_path / name)
    names = list(found(tmp_path, *[tmp_path / name for name in (
        "a/take.oni", "b/take.oni", "b/Take.oni", "c/take.npz", "c/take.oni", "b/take.oni")]))
    assert names == ["a_take", "b_take", "b_Take-2", "c_take", "c_take-2"]


def test_a_folder_is_called_as_it_is_from_within_too(take, monkeypatch):
    monkeypatch.chdir(take)
    assert [one.name for one in find_inputs(["."])] == ["take"]
    assert [one.name for one in find_inputs([f"{take}?end=stop"])] == ["take"]


def test_calibrations_beside_recordings_are_passed_over(take, tmp_path):
    side = recording(tmp_path / "take.calibration.json")
    assert found(tmp_path, take, side) == {"take": "take"}


def test_an_empty_folder_is_left_to_who_opens_it(tmp_path):
    assert [one.uri for one in find_inputs([str(tmp_path)])] == [str(tmp_path)]


def test_a_folder_that_may_not_be_read_is_named_and_stops_nothing(take, tmp_path, monkeypatch):
    (tmp_path / "closed").mkdir()
    listed = Path.iterdir

    def closed(path):
        if path.name == "closed":
            raise PermissionError(13, "Permission denied")
        return listed(path)

    monkeypatch.setattr(Path, "iterdir", closed)
    assert [(one.name, one.problem) for one in find_inputs([str(tmp_path)])] == [
        ("closed", "Permission denied"), ("take", "")]


def test_a_sensor_is_no_file(take):
    with pytest.raises(UsageError, match="`denseface up` serves a sensor"):
        find_inputs([str(take), "openni2:"])
