"""`denseface reconstruct` of several files, of folders, of all frames."""

import csv
import json
from collections import Counter

import pytest

from denseface.service.cli import main
from denseface.service.tools.reconstruction import many
from tests.unit.service.tools.reconstruction.conftest import made_up, write_frame


def run(capsys, *arguments):
    try:
        status = main(["reconstruct", *map(str, arguments)])
    except SystemExit as exit_:
        status = exit_.code
    told = capsys.readouterr()
    return status, told.out.splitlines(), told.err.splitlines()


def endings(folder):
    return Counter(path.suffix for path in folder.iterdir())


def test_several_files_become_faces_and_a_table(tmp_path, capsys):
    frames = [write_frame(tmp_path / name / "f.npz") for name in ("ann", "bob")]
    status, out, err = run(capsys, *frames, "-o", tmp_path / "new" / "out")
    assert (status, err[-1]) == (0, "warning, 2 of 2 frames: it is made up")
    assert out[0].split() == "name frame measured dense sigma mm ms remark".split()  # noqa: SIM905
    assert [line.split() for line in out[1:3]] == [
        [name, "0", "26", "102", "1.31", "1", "1", "warning"] for name in ("ann_f", "bob_f")]
    assert out[4:6] == ["2 faces", "medians: 102 dense points, sigma 1.31 mm, 1 ms"]
    assert out[6].startswith(f"{tmp_path}/new/out/: 2 .ply, ")
    assert out[6].endswith("; MeshLab, CloudCompare and Blender open it")
    assert sorted(path.name for path in (tmp_path / "new" / "out").iterdir()) == [
        "ann_f.ply", "bob_f.ply"]


def test_every_frame_is_taken_and_one_without_a_face_stops_none(take, tmp_path, capsys):
    out_folder = tmp_path / "out"
    status, out, err = run(capsys, take, "--all-frames", "-o", f"{out_folder}/", "--format", "glb",
                           "--report", f"{out_folder}/", "--preview", f"{out_folder}/")
    assert status == 1
    assert [line.split()[:2] for line in out[1:4]] == [
        ["take_0000", "0"], ["take_0001", "1"], ["take_0002", "2"]]
    assert out[2].endswith("no face found: too wide")
    assert out[5] == "2 faces, 1 frame without a face"
    assert err[-1] == "denseface reconstruct: 1 of 3 gave no face; the table says why"
    assert endings(out_folder) == {".glb": 2, ".json": 2, ".png": 3}
    assert json.loads((out_folder / "take_0002.json").read_text())["dense_points"] == 102


def test_the_table_is_a_file_too_of_one_input_as_well(take, tmp_path, capsys):
    (take / "000002.npz").write_bytes(b"cut")
    table = tmp_path / "faces.csv"
    status, out, _ = run(capsys, take, "--all-frames", "--table", table)
    assert (status, out[-1].partition(": ")[0]) == (2, f"{tmp_path}/faces.csv")
    with table.open(newline="") as file:
        first, second, third = csv.DictReader(file)
    assert first == {"name": "take_0000", "source": str(take), "frame": "0", "measured": "26",
                     "dense": "102", "sigma_mm": "1.306", "ms": "1.0",
                     "warnings": "it is made up", "why_not": ""}
    assert (second["dense"], second["why_not"]) == ("", "no face found: too wide")
    assert "000002.npz" in third["why_not"]
    run(capsys, take, "--table", table)
    assert table.read_text().splitlines()[1].startswith("take,")


def test_what_cannot_be_read_is_named_and_stops_none(take, tmp_path, capsys):
    (take / "000001.npz").write_bytes(b"cut")
    status, out, err = run(capsys, tmp_path / "none.oni", take, "--all-frames", "-o",
                           f"{tmp_path}/out/")
    assert status == 2
    assert "none.oni: no such file" in out[1]
    assert "000001.npz" in out[3]
    assert out[6] == "2 faces, 2 unreadable"
    assert err[-1] == "denseface reconstruct: 2 of 4 gave no face; the table says why"
    assert endings(tmp_path / "out") == {".ply": 2}


def test_a_frame_of_each_is_taken(take, tmp_path, capsys):
    single = write_frame(tmp_path / "one.npz")
    status, out, _ = run(capsys, take, single, "--frame", 2)
    assert status == 2
    assert out[1].split()[:3] == ["take", "2", "26"]
    assert "one.npz: has 1 frames (0 to 0), --frame asks for 2" in out[2]
    assert out[-1].startswith("nothing was written: -o writes the face")


def test_what_is_there_is_replaced_and_names_of_frames_are_never_another_files(
        take, tmp_path, capsys):
    write_frame(tmp_path / "take_0000.npz")
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "take_0000.ply").write_text("old")
    status, out, _ = run(capsys, take, tmp_path / "take_0000.npz", "--all-frames", "-o",
                         tmp_path / "out")
    assert (status, out[4].split()[0]) == (1, "take_0000-2")
    assert (tmp_path / "out" / "take_0000.ply").read_bytes().startswith(b"ply")
    assert endings(tmp_path / "out") == {".ply": 3}


def test_ctrl_c_keeps_what_was_done_and_tells_of_it(take, tmp_path, capsys, monkeypatch):
    done = []

    def interrupted(frame, settings):
        if done:
            raise KeyboardInterrupt
        done.append(frame)
        return made_up(frame, settings)

    monkeypatch.setattr(many, "reconstruct", interrupted)
    status, out, _ = run(capsys, take, "--all-frames", "-o", f"{tmp_path}/out/")
    assert status == 130
    assert [line.split()[0] for line in out[:2]] == ["name", "take_0000"]
    assert out[3] == "1 face; stopped before the end"
    assert endings(tmp_path / "out") == {".ply": 1}


def test_a_file_that_cannot_be_written_ends_it(take, tmp_path, capsys):
    (tmp_path / "out" / "take_0000.ply").mkdir(parents=True)
    status, out, err = run(capsys, take, "--all-frames", "-o", f"{tmp_path}/out/")
    assert status == 1
    assert "0 faces; stopped before the end" in out
    assert err[-1] == (f"denseface reconstruct: {tmp_path}/out/take_0000.ply: is a folder, "
                       "expected a file")


def test_where_nothing_can_be_written_no_frame_is_read(take, tmp_path, capsys):
    (tmp_path / "file").touch()
    status, out, (line,) = run(capsys, take, "--all-frames", "-o", f"{tmp_path}/file/out/")
    assert (status, out) == (2, [])
    assert line.startswith(f"denseface reconstruct: {tmp_path}/file/out/take.ply: ")


@pytest.mark.parametrize("arguments", [
    ["{tmp}/a.npz", "{tmp}/b.npz", "-o", "{tmp}", "--format", "npz"],
    ["{tmp}/a.npz", "-o", "{tmp}/take/../a.npz"],
    ["{tmp}/take", "--all-frames", "-o", "{tmp}/take", "--format", "npz"],
    ["{tmp}/a.npz", "--calibration", "{tmp}/c.json", "--report", "{tmp}/c.json"],
    ["--depth", "{tmp}/d.png", "--preview", "{tmp}/d.png"],
])
def test_nothing_replaces_what_is_read(take, tmp_path, capsys, arguments):
    for name in ("a", "b"):
        write_frame(tmp_path / f"{name}.npz")
    (tmp_path / "c.json").touch()
    (tmp_path / "d.png").touch()
    before = {path: path.read_bytes() for path in tmp_path.rglob("*.*")}
    status, out, (line,) = run(capsys, *[one.format(tmp=tmp_path) for one in arguments])
    assert (status, out) == (2, [])
    assert "read" in line
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.*")} == before


@pytest.mark.parametrize(("arguments", "message"), [
    (["--all-frames", "-o", "{tmp}/face.ply"], "-o {tmp}/face.ply: expected a folder, as there are "
     "several faces: -o DIR/"),
    (["--all-frames", "--report", "r.json"], "--report r.json: expected a folder"),
    (["--all-frames", "--frame", "1"], "not allowed with"),
    (["--all-frames", "--frames", "2"], "--frames is given with --all-frames"),
    (["--table", "t.txt"], "t.txt: expected a name that ends in .csv"),
    (["-o", ""], "expected OUT|DIR/, found ''"),
    (["--format", "stl"], "--format stl: expected with a folder"),
    (["--format", "stl", "-o", "face.glb"], "--format stl: expected with a folder"),
    (["--depth", "d.png"], "found both"),
])
def test_wrong_usage_is_one_line(take, tmp_path, capsys, arguments, message):
    status, out, err = run(capsys, take, *[one.format(tmp=tmp_path) for one in arguments])
    assert (status, out) == (2, [])
    (line,) = err
    assert message.format(tmp=tmp_path) in line
