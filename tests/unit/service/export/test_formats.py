"""Faces to files and back."""

import json
import os
import re
import struct
import subprocess
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import open3d as o3d
import pytest
from scipy.spatial import KDTree

from denseface.recon.face import MAX_STEP, Consent
from denseface.service.errors import FormatError
from denseface.service.export import FORMATS, ExportOptions, load_face, save_face
from denseface.service.export.mesh import triangulate
from denseface.service.export.options import PLAIN
from denseface.service.export.printing import Printing
from tests.unit.service.faces import small_face

OPEN = ExportOptions(printing=Printing(solid="open"))
REPOSITORY = Path(__file__).parents[4]


def test_ply_has_exactly_the_properties_that_are_promised(tmp_path):
    face = small_face()
    save_face(face, tmp_path / "face.ply")
    header = (tmp_path / "face.ply").read_bytes().split(b"end_header")[0].decode()
    assert "format binary_little_endian 1.0" in header
    assert re.findall(r"property (.*)", header) == [
        "float x", "float y", "float z", "float nx", "float ny", "float nz",
        "uchar red", "uchar green", "uchar blue", "float sigma"]


@pytest.mark.parametrize("ending", [".ply", ".pcd", ".PLY"])
def test_clouds_come_back(tmp_path, ending):
    face = small_face()
    save_face(face, tmp_path / f"face{ending}")
    back = o3d.t.io.read_point_cloud(str(tmp_path / f"face{ending}"))
    np.testing.assert_array_equal(back.point.positions.numpy(), face.dense.points)
    np.testing.assert_array_equal(back.point.colors.numpy(), face.dense.colors)
    np.testing.assert_array_equal(back.point.normals.numpy(), face.dense.normals)
    np.testing.assert_array_equal(back.point.sigma.numpy()[:, 0], face.dense.sigma)
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("ending", [".obj", ".glb", ".stl"])
def test_meshes_come_back(tmp_path, ending):
    face = small_face()
    save_face(face, tmp_path / f"face{ending}", options=OPEN if ending == ".stl" else PLAIN)
    back = o3d.io.read_triangle_mesh(str(tmp_path / f"face{ending}"))
    assert len(back.triangles) == len(triangulate(face.dense))
    expected = face.dense.points[triangulate(face.dense)].astype(float)
    if ending == ".glb":
        expected = expected * [1, -1, -1] / 1000
    found = np.asarray(back.vertices)[np.asarray(back.triangles)].mean(axis=1)
    distances, _ = KDTree(found).query(expected.mean(axis=1))
    assert distances.max() < 2e-6 * np.abs(expected).max()
    if ending == ".obj":
        _, order = KDTree(np.asarray(back.vertices)).query(face.dense.points)
        colors, normals = np.asarray(back.vertex_colors), np.asarray(back.vertex_normals)
        np.testing.assert_allclose(colors[order] * 255, face.dense.colors, atol=0.01)
        np.testing.assert_allclose(normals[order], face.dense.normals, atol=1e-4)


def test_glb_follows_the_format(tmp_path):
    face = small_face()
    save_face(face, tmp_path / "face.glb")
    data = (tmp_path / "face.glb").read_bytes()
    magic, version, length, json_length, _ = struct.unpack_from("<4sIIII", data)
    assert (magic, version, length, json_length % 4) == (b"glTF", 2, len(data), 0)
    document = json.loads(data[20:20 + json_length])
    start = 28 + json_length
    position, normal, color, indices = document["accessors"]
    views = document["bufferViews"]

    def array(accessor, dtype):
        view = views[accessor["bufferView"]]
        return np.frombuffer(data, dtype, view["byteLength"] // np.dtype(dtype).itemsize,
                             start + view["byteOffset"])

    points = array(position, "<f4").reshape(-1, 3)
    assert points.min(axis=0).tolist() == position["min"]
    assert points.max(axis=0).tolist() == position["max"]
    assert np.ptp(points[:, 1]) == pytest.approx(np.ptp(face.dense.points[:, 1]) / 1000, rel=1e-5)
    assert (array(normal, "<f4").reshape(-1, 3)[:, 2] > 0).all()
    assert (color["componentType"], color["type"]) == (5126, "VEC3")  # MeshLab misreads 16 bits
    assert "normalized" not in color
    linear = array(color, "<f4").reshape(-1, 3)[:, 2]
    assert linear == pytest.approx(((90 / 255 + 0.055) / 1.055) ** 2.4, abs=1e-6)
    assert array(indices, "<u4").max() < position["count"]


def test_the_front_of_each_triangle_is_toward_the_camera():
    dense = small_face().dense
    a, b, c = np.moveaxis(dense.points[triangulate(dense)], 1, 0)
    normals = np.cross(b - a, c - a)
    assert (normals[:, 2] < 0).all()


def test_triangles_cover_the_grid_once_and_no_step():
    dense = small_face().dense
    assert len(triangulate(dense)) == 2 * 11 * 8 - 2 * 4
    torn = dense.points.copy()
    torn[dense.cells[:, 1] >= 5, 2] += 100
    triangles = triangulate(replace(dense, points=torn))
    left = dense.cells[triangles, 1] < 5
    assert (left.all(axis=1) | ~left.any(axis=1)).all()
    assert len(triangles) > 100


def test_the_page_for_visitors_joins_the_same_points():
    source = (REPOSITORY / "service/kiosk/frontend/src/viewer/surface.ts").read_text()
    limit, = re.findall(r"const MAX_STEP = (.*);", source)
    assert float(limit) == MAX_STEP


def test_npz_gives_the_whole_face_back(tmp_path):
    consent = Consent(text_version="1", language="en", retention_s=60.0,
                      at=datetime(2026, 1, 31, tzinfo=UTC))
    face = small_face()
    face = replace(face, report=face.report.model_copy(update={"consent": consent}))
    save_face(face, tmp_path / "face.npz")
    back = load_face(tmp_path / "face.npz")
    for name in ("points", "colors"):
        np.testing.assert_array_equal(getattr(back.initial, name), getattr(face.initial, name))
    for name in ("points", "colors", "normals", "sigma", "cells"):
        np.testing.assert_array_equal(getattr(back.dense, name), getattr(face.dense, name))
    assert (back.dense.grid_shape, back.dense.grid_step_mm) == (
        face.dense.grid_shape, face.dense.grid_step_mm)
    assert back.report == face.report


@pytest.mark.parametrize("contents", [b"", b"garbage", None, {"depth": np.zeros(3)},
                                      {"dense_points": np.array([object()])}])
def test_what_is_no_face_is_named(tmp_path, contents):
    path = tmp_path / "face.npz"
    if isinstance(contents, bytes):
        path.write_bytes(contents)
    elif contents:
        np.savez(path, **contents)
    with pytest.raises(FormatError, match=r"face\.npz: "):
        load_face(path)


def test_a_face_of_wrong_shapes_is_named(tmp_path):
    path = tmp_path / "face.npz"
    save_face(small_face(), path)
    with np.load(path) as file:
        arrays = dict(file)
    for name, wrong in (("dense_points", arrays["dense_points"][:5]), ("report", np.array("{}")),
                        ("grid_shape", np.array(3)), ("grid_shape", np.array([2**40, 2**40])),
                        ("grid_step_mm", np.float64("nan")), ("report", np.array("\ud800")),
                        ("report", np.zeros(2**20)),
                        ("dense_sigma", -arrays["dense_sigma"]),
                        ("dense_cells", arrays["dense_cells"] + 99)):
        np.savez(path, **arrays | {name: wrong})
        with pytest.raises(FormatError, match=r"face\.npz: "):
            load_face(path)


def test_an_unknown_ending_is_named(tmp_path):
    with pytest.raises(FormatError, match=r"face\.xyz: ending \.xyz, expected one of \.ply \.pcd"):
        save_face(small_face(), tmp_path / "face.xyz")
    with pytest.raises(FormatError, match="ending missing"):
        save_face(small_face(), tmp_path / "face")


def test_a_folder_in_the_file_s_place_leaves_nothing_behind(tmp_path):
    (tmp_path / "face.ply").mkdir()
    with pytest.raises(OSError, match="directory"):
        save_face(small_face(), tmp_path / "face.ply")
    assert [path.name for path in tmp_path.iterdir()] == ["face.ply"]


@pytest.mark.usefixtures("no_picture")
@pytest.mark.parametrize("ending", FORMATS)
def test_writing_takes_no_open3d_which_cannot_be_loaded_without_libgl(
        tmp_path, monkeypatch, ending):
    monkeypatch.setitem(sys.modules, "open3d", None)
    save_face(small_face(), tmp_path / f"face{ending}")
    assert (tmp_path / f"face{ending}").stat().st_size > 500


def test_a_file_for_which_there_is_no_room_is_not_left_half_written(tmp_path):
    """No file may have more than 2 KiB here: what the system says is as on a full disk."""
    code = """
import resource, sys
from pathlib import Path
from denseface.service.export import FORMATS, save_face
from denseface.service.export.turning import views
views._FRAMES = 4
from tests.unit.service.faces import small_face
resource.setrlimit(resource.RLIMIT_FSIZE, (2048, 2048))
for ending in FORMATS:
    if ending in (".mp4", ".png"):  # OpenCV's encoder does not say why; drawing takes a second
        continue
    path = Path(sys.argv[1], "face" + ending)
    path.write_text("the good one")
    try:
        save_face(small_face(), path)
    except OSError as error:
        print(ending, error.strerror)
    assert path.read_text() == "the good one"
"""
    done = subprocess.run([sys.executable, "-c", code, tmp_path], check=True, text=True,
                          capture_output=True)
    assert done.stdout.splitlines() == [
        f"{ending} File too large" for ending in FORMATS if ending not in (".mp4", ".png")]
    assert len(list(tmp_path.iterdir())) == len(FORMATS) - 2


@pytest.mark.usefixtures("no_picture")
@pytest.mark.parametrize("ending", FORMATS)
def test_what_others_put_in_the_way_is_not_followed(tmp_path, ending):
    """In a folder of others, a name that can be guessed may be a link to a file of ours."""
    victim = tmp_path / "victim"
    victim.write_text("precious")
    for name in (f".face.{os.getpid()}.tmp{ending}", f".face{ending}.{os.getpid()}.tmp",
                 f"face{ending}"):
        (tmp_path / name).symlink_to(victim)
    save_face(small_face(), tmp_path / f"face{ending}")
    assert victim.read_text() == "precious"
    assert not (tmp_path / f"face{ending}").is_symlink()
