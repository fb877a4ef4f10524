"""`denseface reconstruct` of one frame: what it says of what it wrote, and of what it did not."""

from pathlib import Path

import cv2
import numpy as np

from denseface.recon import CoarseDepthError
from denseface.service.tools.reconstruction.refused import explained
from tests.unit.service.tools.reconstruction.conftest import CANDIDATE, write_frame
from tests.unit.service.tools.reconstruction.test_many import run


def test_each_file_is_named_with_what_it_is_and_what_opens_it(take, tmp_path, capsys):
    status, out, _ = run(
        capsys, take, "--frame", 2, "-o", tmp_path / "f.glb", "--report", tmp_path / "r.json",
        "--preview", tmp_path / "p.png")
    size = (tmp_path / "f.glb").stat().st_size
    assert status == 0
    assert out[:2] == ["26 measured points, 102 dense points, 1 ms",
                       f"{tmp_path}/f.glb: mesh of 102 points, {size / 1000:.1f} kB; Blender, "
                       "MeshLab and Windows 3D Viewer open it"]
    assert out[2].startswith(f"{tmp_path}/r.json: report, ")
    assert out[3].startswith(f"{tmp_path}/p.png: picture of the face, ")
    assert len(out) == 4


def test_where_nothing_is_asked_for_that_is_said(take, capsys):
    status, out, _ = run(capsys, take)
    assert status == 0
    assert out[1:] == [
        "nothing was written: -o writes the face, --preview a picture of it, --report the report",
        "frame 0 of 3: --frame N takes another, --all-frames each"]


def test_a_folder_gets_a_file_by_the_inputs_name(take, tmp_path, capsys):
    status, out, _ = run(capsys, take, "-o", f"{tmp_path}/new/", "--format", "pcd")
    assert (status, out[1].partition(":")[0]) == (0, f"{tmp_path}/new/take.pcd")


def test_no_face_names_file_and_frame_and_what_to_try(take, capsys):
    status, out, err = run(capsys, take, "--frame", 1)
    assert (status, out) == (1, [])
    assert err == [
        f"denseface reconstruct: {take}, frame 1: no face found: too wide; --frame takes another "
        "of its 3 frames, --all-frames each; --calibration FILE where its cameras are others than "
        "assumed; --preview P.png draws what was looked at"]


def test_no_face_is_drawn_in_place_of_one(tmp_path, capsys):
    path = write_frame(tmp_path / "wall.npz", face=False)
    picture = tmp_path / "p.png"
    status, _, (line,) = run(capsys, path, "-o", tmp_path / "f.ply", "--preview", picture)
    assert status == 1
    assert line.endswith(f"{picture} shows what was looked at")
    assert cv2.imread(str(picture)).shape[1] > 1000
    assert not (tmp_path / "f.ply").exists()


def test_several_boxes_are_counted_by_their_verdicts():
    error = CoarseDepthError("steps of 12 mm: was it kept in 8 bits?")
    error.candidates = tuple(CANDIDATE.model_copy(update={"verdict": verdict})
                             for verdict in ("chosen", "flat", "flat", "farther"))
    told = explained(error, "a.npz, frame 0", frames=1, picture=Path("p.png"))
    assert isinstance(told, CoarseDepthError)
    assert told.candidates == error.candidates
    assert str(told) == (
        "a.npz, frame 0: steps of 12 mm: was it kept in 8 bits? (2 boxes: flat, 1 box: taken, "
        "1 box: farther away); p.png shows what was looked at")


def test_what_a_texture_takes_is_beside_it_and_named(take, tmp_path, capsys):
    status, out, _ = run(capsys, take, "-o", tmp_path / "f.obj", "--textured", "--holes", "close")
    names = ["f.obj", "f.mtl", "f.texture.jpg"]
    assert status == 0
    assert [line.split(": ")[0] for line in out[1:4]] == [f"{tmp_path}/{name}" for name in names]
    assert [line.split(": ")[1].split(",")[0] for line in out[1:4]] == [
        "mesh of 102 points", "its material", "its texture"]
    photo = cv2.imread(str(tmp_path / "f.texture.jpg"))
    assert abs(photo.astype(int) - 90).max() < 5, "the frame's, not the points'"


def test_a_texture_replaces_no_image_that_is_read(take, tmp_path, capsys):
    for name, image in (("d.png", np.full((120, 160), 700, np.uint16)),
                        ("f.texture.png", np.zeros((120, 160, 3), np.uint8))):
        cv2.imwrite(str(tmp_path / name), image)
    (tmp_path / "f.texture.png").rename(tmp_path / "f.texture.jpg")
    status, _, said = run(capsys, "--depth", tmp_path / "d.png", "--color",
                          tmp_path / "f.texture.jpg", "-o", tmp_path / "f.obj", "--textured")
    assert status == 2
    assert f"{tmp_path}/f.texture.jpg: is read, and would be replaced" in said[0]


def test_a_compact_file_is_named_with_what_opens_it(take, tmp_path, capsys):
    status, out, _ = run(capsys, take, "-o", tmp_path / "f.glb", "--compact", "--textured")
    assert status == 0
    assert out[1].endswith("; pages with three.js or Babylon.js open it, few other programs do")
    assert out[1].startswith(f"{tmp_path}/f.glb: mesh of 102 points, ")


def test_each_of_several_faces_has_its_own_texture(take, tmp_path, capsys):
    status, _, _ = run(capsys, take, "--all-frames", "-o", f"{tmp_path}/new/", "--format", "obj",
                       "--textured")
    assert status == 1, "one has no face"
    assert sorted(path.name for path in (tmp_path / "new").iterdir()) == [
        f"take_000{number}.{ending}" for number in (0, 2)
        for ending in ("mtl", "obj", "texture.jpg")]
