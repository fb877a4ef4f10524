"""What `denseface info` says of every file that is written here, and of files that lie."""

import io
import json
import zipfile
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from denseface.capture.errors import CaptureError
from denseface.capture.npz import save_frame
from denseface.recon.face import Face
from denseface.service.cli import main
from denseface.service.errors import FormatError
from denseface.service.export import FORMATS, save_face, save_report
from denseface.service.export.face_grid import encode_face_grid
from denseface.service.export.printing.stl import to_stl
from denseface.service.export.printing.threemf import MODEL, to_3mf
from denseface.service.export.provenance import provenance
from denseface.service.export.render import portrait
from denseface.service.export.turning import animation, views
from denseface.service.tools.info import as_lines, inspect
from tests.unit.frames import calibration
from tests.unit.service.faces import small_face, small_frame

RECORDINGS = Path(__file__).parents[4] / "fixtures/recorded_oni"
TOLD = {"capture_id": "visit-7", "captured_at": "2026-11-29T12:00:00.033+00:00",
        "sensor": "A00365", "source": "take.oni#12", "calibration": "beside: a.calibration.json"}


def face() -> Face:
    made = small_face(20, 14)
    return replace(made, report=made.report.model_copy(update=TOLD))


@pytest.fixture(scope="module")
def files(tmp_path_factory) -> Path:
    """Each kind of file; most have no ending: it is by their contents that they are known."""
    folder, made = tmp_path_factory.mktemp("files"), face()
    for ending in (".ply", ".pcd", ".npz", ".obj", ".glb"):
        save_face(made, folder / f"face{ending}")
    save_report(made, folder / "report")
    save_frame(replace(small_frame(), depth=np.full((6, 8), 900, np.uint16)), folder / "frame.npz")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(views, "_FRAMES", 8)
        (folder / "turning").write_bytes(animation.to_webp(made))
        patch.setattr(animation, "_CODECS", ("mp4v",))
        with suppress(FormatError):  # a machine without an encoder
            (folder / "video").write_bytes(animation.to_mp4(made))
    for name, data in (("plate.stl", to_stl(made)), ("solid", to_3mf(made)),
                       ("browser", encode_face_grid(made)), ("picture", portrait(made, 64)),
                       ("calibration", calibration().to_json().encode())):
        (folder / name).write_bytes(data)
    return folder


@pytest.mark.parametrize(("name", "kind"), [
    ("face.ply", "cloud"), ("face.pcd", "cloud"), ("face.npz", "face"), ("face.obj", "mesh"),
    ("face.glb", "mesh"), ("browser", "face for browsers"), ("report", "report")])
def test_a_face_is_counted_and_measured_in_every_format(files, name, kind):
    found, dense = inspect(files / name), face().dense
    assert (found["kind"], found["points"]) == (kind, len(dense))
    assert found["bytes"] == (files / name).stat().st_size
    if name.startswith("face"):
        assert found["size_mm"] == pytest.approx(np.ptp(dense.points, axis=0), abs=0.01)
        assert found["lowest_mm"] == pytest.approx(dense.points.min(axis=0), abs=0.01)
        assert found["colors"]
        assert found["frame"].startswith("the depth camera's")
    if kind == "mesh":
        assert not found["closed"]


@pytest.mark.parametrize("name", ["plate.stl", "solid"])
def test_a_solid_is_known_as_one(files, name):
    found = inspect(files / name)
    assert found["kind"] == "solid for 3D printing"
    assert found["closed"]
    assert found["lowest_mm"] == [0, 0, 0]
    assert found["frame"].startswith("the printer's")


@pytest.mark.parametrize("name", ["face.ply", "face.pcd", "face.npz", "face.obj", "face.glb",
                                  "solid", "picture", "turning", "video", "report"])
def test_where_a_face_comes_from_is_told(files, name):
    if name == "video" and not (files / name).exists():
        pytest.skip("this machine has no encoder for video")
    found = inspect(files / name)["provenance"]
    assert {one: found[one] for one in TOLD} == TOLD
    assert found["generator"] == provenance(face().report)["generator"]


def test_pictures_and_their_loop_are_measured(files):
    assert inspect(files / "picture")["pixels"] == "64x64"
    turning = inspect(files / "turning")
    assert (turning["frames"], turning["pixels"]) == (8, f"{views.WIDTH}x{views.HEIGHT}")
    assert turning["seconds"] == pytest.approx(8 / views.FRAMES_PER_S, abs=0.01)


def test_a_frame_and_a_calibration_are_told(files):
    frame = inspect(files / "frame.npz")
    assert (frame["kind"], frame["depth"], frame["color"]) == ("frame", "8x6", "10x7")
    assert (frame["nearest_mm"], frame["measured"]) == (900, 1)
    found = inspect(files / "calibration")
    assert found["kind"] == "calibration"
    assert found["depth_camera"].startswith("{0.width}x{0.height}, fx".format(calibration().depth))


def test_a_recording_is_told():
    found = inspect(RECORDINGS / "turned_18.oni")
    assert (found["kind"], found["frames"], found["depth"]) == ("recording", 3, "640x480")


def test_every_file_is_told_in_lines(files):
    for path in files.iterdir():
        title, *lines = as_lines(inspect(path))
        assert title.startswith(f"{path}: ")
        assert lines
        assert all(line.isprintable() and len(line) < 350 for line in (title, *lines))


def test_what_is_cut_short_or_damaged_is_one_line(files, tmp_path):
    rng = np.random.default_rng(1)
    for path in files.iterdir():
        data = path.read_bytes()
        for cut in (1, 5, 21, 100, len(data) // 2, len(data) - 1):
            _told_or_refused(tmp_path / path.name, data[:cut])
        for _ in range(12):
            wrong = bytearray(data)
            for at in rng.integers(0, min(len(data), 3000), 4):
                wrong[at] = rng.integers(256)
            _told_or_refused(tmp_path / path.name, bytes(wrong))


def _told_or_refused(path: Path, data: bytes) -> None:
    path.write_bytes(data)
    try:
        lines = as_lines(inspect(path))
        json.dumps(inspect(path))
    except (FormatError, CaptureError) as error:
        lines = [str(error)]
        assert lines[0].startswith(str(path))
    assert all("\n" not in line for line in lines)


@pytest.mark.parametrize(("name", "data", "said"), [
    ("x", b"", "x: is empty"),
    ("x.txt", b"hello", "nothing that is known here: expected a face"),
    ("x.stl", b"solid x", "cut short"),
    ("x", b"PK\3\4", "damaged, or cut short"),
    ("x", b"\0\0\0\x08ftyp", "cut short: it has no table of its frames"),
    ("x", b"\0\0\0\x18ftyp", "damaged .cut short"),
    ("x.json", b"{}", "depth: Field required"),
    ("x", b'{"dense_points": 3}', "face_box: "),
    ("x", b"DFGR" + bytes(4) + b"\xff" * 4, "version 0 with a header of 4294967295 bytes"),
    ("x", b"\x89PNG\r\n\x1a\n", "damaged"),
])
def test_what_is_nothing_of_ours_is_said(tmp_path, name, data, said):
    (tmp_path / name).write_bytes(data)
    with pytest.raises((FormatError, CaptureError), match=said):
        inspect(tmp_path / name)


def test_a_model_cannot_take_the_memory(tmp_path):
    """Entities that unfold without end, and counts that nothing stands behind."""
    unfolding = ('<?xml version="1.0"?><!DOCTYPE x [<!ENTITY a "aaaa">]>'
                 "<model><metadata name='Title'>&a;</metadata></model>")
    wrong = ("<model><object><vertex x='0' y='0' z='0'/>"
             "<triangle v1='0' v2='0' v3='9'/></object></model>")
    for text, said in ((unfolding, "document type"), (wrong, "point that is not there"),
                       ("<model/>", "no triangles"), ("<model>", "no element found")):
        data = io.BytesIO()
        with zipfile.ZipFile(data, "w") as archive:
            archive.writestr(MODEL, text)
        (tmp_path / "x.3mf").write_bytes(data.getvalue())
        with pytest.raises(FormatError, match=said):
            inspect(tmp_path / "x.3mf")


def test_the_command_goes_on_after_a_file_that_cannot_be_read(files, tmp_path, capsys):
    assert main(["info", str(files / "face.ply"), str(tmp_path / "none"), str(tmp_path),
                 str(files / "solid")]) == 2
    said = capsys.readouterr()
    assert said.out.startswith(f"{files / 'face.ply'}: cloud (PLY, binary little endian), ")
    assert f"{files / 'solid'}: solid for 3D printing (3MF), " in said.out
    assert said.err.splitlines() == [
        f"denseface info: {tmp_path / 'none'}: No such file or directory",
        f"denseface info: {tmp_path}: is a folder, expected a file"]


def test_json_is_an_object_in_each_line(files, capsys):
    assert main(["info", "--json", str(files / "face.ply"), str(files / "report")]) == 0
    first, second = map(json.loads, capsys.readouterr().out.splitlines())
    assert (first["kind"], second["kind"]) == ("cloud", "report")
    assert first["points"] == second["points"] == len(face().dense)


def test_every_format_is_told(files):
    assert {*FORMATS} <= {".stl", ".3mf", ".png", ".webp", ".mp4",
                          *(path.suffix for path in files.iterdir())}
