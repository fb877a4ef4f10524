"""Meshes and clouds as other libraries read them: three.js, Khronos's validator, trimesh, plyfile.

Counts, millimetres or metres, y up or down, colours, and which way the front is.
"""

import base64
import io
from pathlib import Path

import numpy as np
import plyfile
import pytest
import trimesh
from PIL import Image
from scipy.ndimage import map_coordinates
from scipy.spatial import KDTree

from denseface.service.errors import UsageError
from denseface.service.export import ExportOptions, FaceFiles, save_face
from denseface.service.export.formats import beside
from denseface.service.export.mesh import face_mesh
from denseface.service.export.options import LIKENESS
from denseface.service.export.reading import read_mesh
from tests.unit.service.export.models.conftest import (
    dome,
    frame_of_dome,
    sample_cloud,
)

TO_CAMERA = np.array([1000, -1000, -1000])
GLB = ("plain.glb", "textured.glb", "compact.glb", "both.glb", "closed.glb", "sample.glb")


def srgb(linear):
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1 / 2.4) - 0.055) * 255


def seen_at(told, image=None):
    """The colours that a viewer gives a mesh's points."""
    if told.get("color"):
        return srgb(np.array(told["color"]))
    image = np.array(Image.open(io.BytesIO(base64.b64decode(told["image"])))
                     if image is None else image, np.float64)
    uv = np.array(told["uv"]) * image.shape[1::-1] - 0.5
    return np.stack([map_coordinates(image[..., k], uv.T[::-1], order=1, mode="nearest")
                     for k in range(3)], axis=1)


def checked(mesh, points, colors, triangles, normals, *, atol, color_atol):
    """A mesh in the camera's frame, mm, is that of ours, its points in whatever order."""
    distance, row = KDTree(mesh.points).query(points)
    assert distance.max() <= atol
    assert set(row) == set(range(len(mesh.points)))
    if colors is not None:
        assert np.abs(colors - mesh.colors[row]).max() <= color_atol
    as_sets = {frozenset(one) for one in mesh.triangles.tolist()}
    assert {frozenset(one) for one in row[triangles].tolist()} == as_sets
    assert len(triangles) == len(mesh.triangles)
    faces = np.cross(points[triangles[:, 1]] - points[triangles[:, 0]],
                     points[triangles[:, 2]] - points[triangles[:, 0]])
    assert (faces[:, 2] < 0).all(), "the front is toward the camera"
    if normals is not None:
        assert np.einsum("ix,ix->i", normals, mesh.normals[row]).min() > np.cos(np.deg2rad(0.3))


@pytest.mark.parametrize("name", GLB)
def test_khronos_validator_has_no_error_and_no_warning(written, name):
    issues = written[name]["issues"]
    assert [one for one in issues if one["severity"] < 2] == []
    assert {one["code"] for one in issues} <= {"UNSUPPORTED_EXTENSION", "IMAGE_NPOT_DIMENSIONS"}


@pytest.mark.parametrize(("name", "atol", "color_atol"), [
    ("plain.glb", 1e-3, 0.1), ("closed.glb", 1e-3, 0.1), ("textured.glb", 1e-3, None),
    ("compact.glb", 0.13, None), ("both.glb", 0.13, None)])
def test_three_reads_the_mesh_that_was_written(written, name, atol, color_atol):
    told = written[name]
    options = ExportOptions(holes="close" if name == "closed.glb" else "leave")
    mesh = face_mesh(written.face.dense, options)
    assert told["vertexColors"] == (color_atol is not None)
    points = np.array(told["position"]) * TO_CAMERA
    checked(mesh, points, seen_at(told) if color_atol else None,
            np.array(told["index"]).reshape(-1, 3), np.array(told["normal"]) * [1, -1, -1],
            atol=atol, color_atol=color_atol)


def test_a_compact_file_has_the_colours_of_the_points(written):
    """Noise is the worst that a JPEG can be given: half of the points are within a tenth."""
    told = written["compact.glb"]
    mesh = face_mesh(written.face.dense)
    _, row = KDTree(mesh.points).query(np.array(told["position"]) * TO_CAMERA)
    assert told["map"] == "srgb"
    assert np.median(np.abs(seen_at(told) - mesh.colors[row])) < 25


def test_a_real_face_of_150_000_points_is_at_most_1_1_mb(written):
    told, size = written["sample.glb"], written.path("sample.glb").stat().st_size
    assert told["points"] > 138_000
    assert told["corners"] > 6 * 137_000
    assert size / told["points"] * 150_000 <= 1_100_000
    np.testing.assert_allclose(
        told["size"], np.ptp(sample_cloud().points, axis=0) / 1000, atol=3e-4)


@pytest.mark.parametrize("name", ["textured.glb", "both.glb"])
def test_the_colour_image_lies_where_the_colour_camera_saw_it(written, name):
    told = written[name]
    points = np.array(told["position"]) * TO_CAMERA
    pixels = written.frame.calibration.color.project(np.add(points, (25, 0, 0)))
    image = written.frame.color.astype(float)
    expected = np.stack([map_coordinates(image[..., k], pixels.T[::-1], order=1)
                         for k in range(3)], axis=1)
    off = np.abs(seen_at(told) - expected).max(axis=1)
    # Along the outline it is that of two pixels farther inside; right of it something hides it.
    inner = (np.abs(points[:, 0] + 2) < 7) & (np.abs(points[:, 1]) < 14)
    assert inner.sum() > 300
    assert off[inner].max() < 4


def test_what_the_colour_camera_does_not_see_has_its_own_colours(written):
    told = written["textured.glb"]
    mesh = face_mesh(written.face.dense)
    points = np.array(told["position"]) * TO_CAMERA
    assert len(mesh.points) < len(points) < 1.5 * len(mesh.points), "a seam's points are twice"
    _, row = KDTree(mesh.points).query(points)
    own = np.abs(seen_at(told)[:, 2] - 40) > 12
    assert 30 < own.sum() < 0.4 * len(points)
    assert np.median(np.abs(seen_at(told) - mesh.colors[row])[own]) < 25


def test_assets_say_where_the_face_comes_from_and_whose_it_is(written):
    for name, rights in (("plain.glb", LIKENESS), ("compact.glb", "Anna B.")):
        asset = written[name]["asset"]
        assert asset["copyright"] == rights
        assert asset["extras"]["capture_id"] == "visit-7"
        assert asset["extras"]["sensor"] == "A00365"
        assert asset["generator"].startswith("denseface ")


@pytest.mark.parametrize("name", ["plain.glb", "textured.glb", "compact.glb", "both.glb"])
def test_it_is_read_back_as_three_reads_it(written, name):
    """Our reader, against that of others: the textures' colours, too."""
    told, mesh = written[name], read_mesh(written.path(name))
    np.testing.assert_allclose(mesh.points, np.array(told["position"]) * TO_CAMERA, atol=1e-3)
    np.testing.assert_array_equal(mesh.triangles.ravel(), told["index"])
    np.testing.assert_allclose(mesh.colors, seen_at(told), atol=3)


@pytest.mark.parametrize("name", ["plain.obj", "plain.stl"])
def test_three_reads_other_meshes_in_millimetres_y_down(written, name):
    told, mesh = written[name], face_mesh(written.face.dense)
    points = np.array(told["position"])
    colors = np.array(told["color"]) if "color" in told else None
    if colors is not None:
        colors = srgb(colors)  # three keeps them in linear light
        assert told["libraries"] == []
    checked(mesh, points, colors, np.arange(len(points)).reshape(-1, 3), None, atol=1e-3,
            color_atol=1)


@pytest.mark.parametrize("name", ["cloud.ply", "cloud.pcd"])
def test_three_reads_clouds_in_millimetres_y_down(written, name):
    told, dense = written[name], written.face.dense
    np.testing.assert_allclose(told["position"], dense.points, atol=1e-4)
    np.testing.assert_allclose(told["normal"], dense.normals, atol=1e-6)
    # three keeps those of a PLY in bytes of linear light, coarse where it is dark.
    np.testing.assert_allclose(srgb(np.array(told["color"])), dense.colors, atol=13)


def test_plyfile_reads_every_property(written):
    read = plyfile.PlyData.read(written.path("cloud.ply"))
    vertex, dense = read["vertex"], written.face.dense
    for names, values in ((("x", "y", "z"), dense.points), (("nx", "ny", "nz"), dense.normals),
                          (("red", "green", "blue"), dense.colors)):
        np.testing.assert_array_equal(np.stack([vertex[name] for name in names], axis=1), values)
    np.testing.assert_array_equal(vertex["sigma"], dense.sigma)
    assert (read.text, read.byte_order) == (False, "<")
    assert "capture_id visit-7" in read.comments
    assert "by denseface, mm" in read.comments


@pytest.mark.parametrize("name", ["plain.glb", "textured.glb", "plain.obj", "textured.obj",
                                  "plain.stl"])
def test_trimesh_reads_meshes(written, name):
    read = trimesh.load_mesh(written.path(name), process=False)
    read.remove_unreferenced_vertices()
    mesh = face_mesh(written.face.dense)
    scale = TO_CAMERA if name.endswith(".glb") else 1
    points = read.vertices * scale
    colors = read.visual.vertex_colors[:, :3] if name == "plain.obj" else None
    checked(mesh, points, colors, read.faces, None, atol=1e-3, color_atol=1)
    if name.startswith("textured"):
        material = read.visual.material
        image = material.baseColorTexture if name.endswith(".glb") else material.image
        # trimesh has the origin below.
        told = {"uv": read.visual.uv * [1, -1] + [0, 1]}
        there = seen_at(told, image)
        want = np.array(written["textured.glb"]["position"]) * TO_CAMERA
        _, row = KDTree(want).query(points)
        same = seen_at(written["textured.glb"])[row]
        assert np.median(np.abs(there - same)) < 1


def test_a_name_beside_an_obj_is_one_that_every_program_reads(tmp_path):
    face, options = dome(12, 12), ExportOptions(texture=frame_of_dome())
    for stem, other in (("my face", "my_face"), ("-x#y", "x_y"), ("Straße.1", "Straße.1"),
                        ("--", "face")):
        save_face(face, tmp_path / f"{stem}.obj", options=options)
        assert beside(f"{stem}.obj") == ()
        names = [path.name for path in beside(f"{stem}.obj", textured=True)]
        assert names == [f"{other}.mtl", f"{other}.texture.jpg"]
        assert f"mtllib {names[0]}\n" in (tmp_path / f"{stem}.obj").read_text()
        assert f"map_Kd {names[1]}\n" in (tmp_path / names[0]).read_text()
        assert (tmp_path / names[1]).read_bytes()[:2] == b"\xff\xd8"


def test_materials_say_where_the_face_comes_from(written):
    assert "# capture_id visit-7\n" in written.path("textured.mtl").read_text()


def test_where_one_file_cannot_be_written_none_is(tmp_path):
    (tmp_path / "face.mtl").mkdir()
    (tmp_path / "face.obj").write_text("the old one")
    with pytest.raises(OSError, match=r"Is a directory: .*face\.mtl"):
        save_face(dome(12, 12), tmp_path / "face.obj", options=ExportOptions(texture="points"))
    assert (tmp_path / "face.obj").read_text() == "the old one"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["face.mtl", "face.obj"]


@pytest.mark.parametrize(("ending", "options", "said"), [
    (".ply", {"compact": True}, "face.ply: compact is for .glb, not .ply"),
    (".stl", {"texture": True}, "face.stl: texture is for .glb or .obj, not .stl"),
    (".obj", {"copyright": "x"}, "face.obj: copyright is for .glb, not .obj"),
    (".npz", {"holes": "close"}, "face.npz: holes is for .glb or .obj or .stl, not .npz"),
])
def test_what_a_format_cannot_have_is_told(tmp_path, monkeypatch, ending, options, said):
    monkeypatch.chdir(tmp_path)
    if "texture" in options:
        options = {"texture": frame_of_dome()}
    with pytest.raises(UsageError) as raised:
        save_face(dome(12, 12), f"face{ending}", options=ExportOptions(**options))
    assert str(raised.value) == said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("options", "said"), [
    ({"holes": "fill"}, "holes: expected leave or close, found str 'fill'"),
    ({"copyright": "two\nlines"}, "copyright: expected a line of at most 400 characters"),
    ({"copyright": "x" * 401}, "copyright: expected a line of at most 400 characters"),
])
def test_options_that_are_none_are_told(options, said):
    with pytest.raises(UsageError, match=said):
        ExportOptions(**options)


def test_a_frame_of_something_else_is_no_texture(tmp_path):
    of = frame_of_dome()
    depth = of.depth.copy()
    depth[:] = 400
    from dataclasses import replace

    with pytest.raises(UsageError, match="the face is not in this frame's colour image"):
        save_face(dome(12, 12), tmp_path / "f.glb",
                  options=ExportOptions(texture=replace(of, depth=depth)))
    bare = replace(of, color=None, color_timestamp_us=of.depth_timestamp_us)
    with pytest.raises(UsageError, match="the frame has no colour image"):
        ExportOptions(texture=bare)


def test_an_obj_with_colours_of_points_stands_alone(written):
    assert [path.name for path in Path(written.folder).glob("*.mtl")] == ["textured.mtl"]
    assert "mtl" not in written.path("plain.obj").read_text()


def test_a_texture_may_be_of_the_points_own_colours(tmp_path):
    """As programs show it that know no colours of points, and where there is no frame."""
    face = dome()
    FaceFiles(tmp_path / "f.obj", textured=True).write(face)
    read = trimesh.load_mesh(tmp_path / "f.obj", process=False)
    mesh = face_mesh(face.dense)
    _, row = KDTree(mesh.points).query(read.vertices)
    told = {"uv": read.visual.uv * [1, -1] + [0, 1]}
    assert np.median(np.abs(seen_at(told, read.visual.material.image) - mesh.colors[row])) < 25
