"""What is compared: faces, meshes, frames, recordings, folders of them, captures of the hub."""

from itertools import islice
from pathlib import Path

import pytest

from denseface.capture import open_source
from denseface.capture.npz import save_frame
from denseface.recon import Settings
from denseface.service.cli import main
from denseface.service.errors import UsageError
from denseface.service.export import save_face
from denseface.service.tools.comparison.sides import Reading, is_face_file, read_side
from denseface.service.tools.frames import FrameChoice
from tests.unit.service.tools.comparison.made_faces import made_face, pose

RECORDING = Path(__file__).resolve().parents[5] / "fixtures" / "recorded_oni" / "frontal_700.oni"


def reading(frames=None, captures=16):
    asked = []

    def fetch(capture_id):
        asked.append(capture_id)
        return made_face(0)

    return Reading(FrameChoice(2**22), Settings(ratio=1), frames, captures, fetch), asked


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("faces")
    save_face(made_face(1), place / "a.npz")
    save_face(made_face(2, pose(3)), place / "b.npz")
    return place


def names(given, how):
    doubts = []
    return [Path(one.name).name for one in read_side(str(given), how, doubts.append)], doubts


def test_a_folder_of_faces_stands_for_each(folder):
    assert names(folder, reading()[0]) == (["a.npz", "b.npz"], [])


def test_a_recording_gives_bursts_spread_over_it():
    with open_source(str(RECORDING)) as source:
        total = source.frame_count
    assert total == 3
    assert names(RECORDING, reading(1, 2)[0])[0] == [
        "frontal_700.oni, frames 0 to 0", "frontal_700.oni, frames 2 to 2"]
    whole, = read_side(str(RECORDING), reading()[0], lambda _: None)
    assert whole.face.report.fused == 3
    with pytest.raises(UsageError, match="has 3 frames, --frames asks for 8"):
        names(RECORDING, reading(8)[0])


def test_frames_and_faces_are_told_apart(folder, tmp_path):
    with open_source(str(RECORDING)) as source:
        for number, frame in enumerate(islice(source, 2)):
            save_frame(frame, tmp_path / f"{number}.npz")
    assert not is_face_file(tmp_path / "0.npz")
    assert is_face_file(folder / "a.npz")
    assert len(read_side(str(tmp_path / "0.npz"), reading()[0], lambda _: None)) == 1
    assert names(tmp_path, reading(1)[0])[0] == [
        f"{tmp_path.name}, frames {number} to {number}" for number in (0, 1)]
    save_face(made_face(3), tmp_path / "face.npz")
    with pytest.raises(UsageError, match="frames beside other files"):
        names(tmp_path, reading()[0])


def test_a_word_that_is_no_file_is_a_capture(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    how, asked = reading()
    assert names("3f2a", how)[0] == ["capture 3f2a"]
    assert asked == ["3f2a"]
    with pytest.raises(UsageError, match=r"x\.ply: no such file"):
        names("x.ply", how)
    (tmp_path / "tiny.obj").write_text("v 0 0 700\nv 1 0 700\nv 0 1 700\nf 1 2 3\n")
    with pytest.raises(UsageError, match=r"tiny\.obj: 3 points, expected a face of 500"):
        names("tiny.obj", how)


def test_the_command_says_what_it_found(folder, tmp_path, capsys):
    save_face(made_face(3, pose(-4), height=3.0, width=24), tmp_path / "after.npz")
    outputs = [tmp_path / f"r{ending}" for ending in (".html", ".json", ".png", ".ply")]
    assert main(["compare", str(folder), str(tmp_path / "after.npz"),
                 *(word for path in outputs for word in ("-o", str(path)))]) == 0
    told = capsys.readouterr()
    assert "changed, at 95 % confidence for the whole face" in told.out
    assert "  1  left cheek at (" in told.out
    assert all(path.stat().st_size > 1000 for path in outputs)
    assert [line.split(":")[0] for line in told.err.splitlines() if "r." in line] == [
        str(path) for path in outputs]
