"""Meshes and clouds from files: ours, those of other libraries, and what is no such file."""

import io
import json
import struct
from pathlib import Path

import numpy as np
import open3d as o3d
import plyfile
import pytest
import trimesh

from denseface.service.errors import FormatError
from denseface.service.export import FORMATS, ExportOptions, save_face
from denseface.service.export.mesh import triangulate
from denseface.service.export.options import PLAIN
from denseface.service.export.printing import Printing
from denseface.service.export.reading import MESH_ENDINGS, read_mesh
from tests.unit.service.faces import small_face

FACE = small_face()
OPEN = ExportOptions(printing=Printing(solid="open"))
POINTS, TRIANGLES = FACE.dense.points, triangulate(FACE.dense)
SQUARE = np.array([[0, 0, 700], [10, 0, 700], [10, 10, 710], [0, 10, 700.5]], np.float32)
TWO = np.array([[0, 1, 2], [0, 2, 3]])
PAINT = np.array([[255, 0, 9], [1, 2, 3], [128, 64, 32], [0, 0, 0]], np.uint8)


def sorted_rows(values):
    return values[np.lexsort(values.T)]


def corners_of(mesh):
    """The corners of each triangle, which begins at its least point: in whatever order they are."""
    corners = np.round(mesh.points[mesh.triangles].astype(float), 3)
    first = np.lexsort(np.moveaxis(corners, 2, 0), axis=1)[:, 0]
    turned = np.take_along_axis(
        corners, ((first[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
    return sorted_rows(turned.reshape(len(corners), 9))


def write(tmp_path, name, data):
    path = tmp_path / name
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return path


@pytest.mark.parametrize("ending", MESH_ENDINGS)
def test_what_is_written_is_read(tmp_path, ending):
    save_face(FACE, tmp_path / f"face{ending}", options=OPEN if ending == ".stl" else PLAIN)
    points, triangles, colors = mesh = read_mesh(tmp_path / f"face{ending}")
    assert points.dtype == np.float32
    if ending == ".stl":
        assert colors is None
    else:
        np.testing.assert_allclose(points, POINTS, atol=1e-3)
        assert colors.dtype == np.uint8
        np.testing.assert_array_equal(colors, FACE.dense.colors)
    if ending in (".ply", ".pcd"):
        assert triangles is None
    else:
        assert triangles.dtype == np.int32
        whole = type(mesh)(POINTS, TRIANGLES, None)
        np.testing.assert_allclose(corners_of(mesh), corners_of(whole), atol=2e-3)


def test_every_format_is_read():
    assert set(MESH_ENDINGS) >= set(FORMATS) - {".3mf", ".png", ".webp", ".mp4"}


def of_trimesh(kind):
    mesh = trimesh.Trimesh(SQUARE, TWO, process=False, vertex_colors=PAINT)
    return mesh.export(file_type=kind)


@pytest.mark.parametrize("ending", [".ply", ".obj", ".stl", ".glb"])
def test_what_trimesh_writes_is_read(tmp_path, ending):
    mesh = read_mesh(write(tmp_path, f"t{ending}", of_trimesh(ending[1:])))
    expected = SQUARE * [1000, -1000, -1000] if ending == ".glb" else SQUARE
    assert np.abs(sorted_rows(mesh.points) - sorted_rows(expected)).max() < 0.1
    assert len(mesh.triangles) == 2
    if ending == ".glb":
        # trimesh writes bytes as they are, which glTF takes for linear light.
        assert mesh.colors[0].tolist() == [255, 0, 53]
    elif ending != ".stl":
        np.testing.assert_array_equal(mesh.colors, PAINT)


@pytest.mark.parametrize("text", [False, True])
@pytest.mark.parametrize("ending", [".ply", ".obj", ".stl", ".pcd"])
def test_what_open3d_writes_is_read(tmp_path, ending, text):
    path = str(tmp_path / f"o{ending}")
    if ending == ".pcd":
        cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(SQUARE))
        cloud.colors = o3d.utility.Vector3dVector(PAINT / 255)
        o3d.io.write_point_cloud(path, cloud, write_ascii=text)
    else:
        mesh = o3d.geometry.TriangleMesh(
            o3d.utility.Vector3dVector(SQUARE), o3d.utility.Vector3iVector(TWO))
        mesh.vertex_colors = o3d.utility.Vector3dVector(PAINT / 255)
        mesh.compute_triangle_normals()
        if ending == ".stl" and text:
            Path(path).write_text(trimesh.Trimesh(SQUARE, TWO, process=False).export(
                file_type="stl_ascii"))
        else:
            o3d.io.write_triangle_mesh(path, mesh, write_ascii=text)
    found = read_mesh(path)
    np.testing.assert_allclose(sorted_rows(found.points), sorted_rows(SQUARE), atol=1e-3)
    if ending != ".stl":
        np.testing.assert_array_equal(found.colors, PAINT)
    assert (found.triangles is None) == (ending == ".pcd")


def ply(faces, *, text, order="="):
    vertices = np.zeros(len(SQUARE), [("x", "f8"), ("quality", "i2"), ("y", "f8"), ("z", "f8"),
                                      ("red", "u1"), ("green", "u1"), ("blue", "u1")])
    for column, name in enumerate("xyz"):
        vertices[name] = SQUARE[:, column]
    for column, name in enumerate(("red", "green", "blue")):
        vertices[name] = PAINT[:, column]
    lists = np.zeros(len(faces), [("flags", "u1"), ("vertex_indices", "O")])
    lists["vertex_indices"] = [np.array(face, np.int32) for face in faces]
    odd = np.zeros(2, [("a", "f4"), ("many", "O")])
    odd["many"] = [np.array([1.5]), np.array([2.5, 3.5])]
    file = io.BytesIO()
    plyfile.PlyData([
        plyfile.PlyElement.describe(odd, "odd", val_types={"many": "f8"}),
        plyfile.PlyElement.describe(vertices, "vertex"),
        plyfile.PlyElement.describe(lists, "face"),
    ], text=text, byte_order=order, comments=["element vertex 9"]).write(file)
    return file.getvalue()


@pytest.mark.parametrize("faces", [
    [[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]], [[0, 1, 2, 3], [0, 1, 2]], [[0, 1], [3, 2, 1]]])
@pytest.mark.parametrize(("text", "order"), [(True, "="), (False, "<"), (False, ">")])
def test_a_ply_of_any_kind_is_read(tmp_path, faces, text, order):
    mesh = read_mesh(write(tmp_path, "p.ply", ply(faces, text=text, order=order)))
    np.testing.assert_array_equal(mesh.points, SQUARE)
    np.testing.assert_array_equal(mesh.colors, PAINT)
    expected = [[face[0], *face[k:k + 2]] for face in faces for k in range(1, len(face) - 1)]
    assert sorted(mesh.triangles.tolist()) == sorted(expected)


def test_an_obj_may_count_from_the_last_and_go_on_in_the_next_line(tmp_path):
    text = ("mtllib a.mtl\nv 0 0 700\nv 1 0 700\nv 1 \\\n1 700\nf -3/1 -2/2/2 -1//3\n"
            "v 9 9 9\nl 1 2\n")
    mesh = read_mesh(write(tmp_path, "o.obj", text))
    assert mesh.points[2].tolist() == [1, 1, 700]
    assert mesh.triangles.tolist() == [[0, 1, 2]]
    assert mesh.colors is None


def glb(document, body=b""):
    text = json.dumps({"asset": {"version": "2.0"}} | document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text
    if body:
        chunks += struct.pack("<II", len(body), 0x004E4942) + body
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


def placed(**node):
    """A triangle of which only the first point is at the origin, without indices, under a node."""
    body = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], "<f4").tobytes()
    return glb({
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "translation": [0, 0, -1]}, {"mesh": 0, **node}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": len(body)}],
        "buffers": [{"byteLength": len(body)}]}, body)


@pytest.mark.parametrize(("node", "points", "turned"), [
    ({}, [[0, 0, 1000], [1000, 0, 1000], [0, -1000, 1000]], False),
    ({"scale": [2, 3, -1]}, [[0, 0, 1000], [2000, 0, 1000], [0, -3000, 1000]], True),
    ({"rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)], "translation": [0, 0.5, 0]},
     [[0, -500, 1000], [0, -1500, 1000], [-1000, -500, 1000]], False),
    ({"matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0.1, 0.2, 0.3, 1]},
     [[100, -200, 700], [1100, -200, 700], [100, -1200, 700]], False),
])
def test_nodes_of_a_glb_place_their_meshes(tmp_path, node, points, turned):
    path = write(tmp_path, "g.glb", placed(**node))
    mesh = read_mesh(path)
    np.testing.assert_allclose(mesh.points, points, atol=1e-3)
    assert mesh.triangles.tolist() == [[2, 1, 0] if turned else [0, 1, 2]]
    found = trimesh.load_mesh(path, process=False)
    np.testing.assert_allclose(found.vertices * [1000, -1000, -1000], points, atol=1e-3)
    assert found.face_normals[0] @ np.cross(*np.diff(
        mesh.points[mesh.triangles[0]] * [1, -1, -1], axis=0)) > 0


def wrong():
    """Name: file's name, its bytes, what is said."""
    save = {ending: FORMATS[ending] for ending in (".ply", ".pcd", ".obj", ".stl", ".glb")}
    from denseface.service.export.formats import face_bytes

    whole = {ending: face_bytes(FACE, ending) for ending in save}
    head = b"ply\nformat ascii 1.0\n"
    point = b"element vertex 1\nproperty float x\nproperty float y\nproperty float z\n"
    binary = head.replace(b"ascii", b"binary_little_endian")
    pcd_head = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\nPOINTS 1\nDATA "
    return {
        "no ending": ("face", b"", "ending missing, expected one of .ply .pcd .obj .stl .glb .npz"),
        "a text": ("face.txt", b"", "ending .txt"),
        "empty": ("e.ply", b"", "does not begin with 'ply'"),
        "a ply without end": ("e.ply", head + point, "no end_header"),
        "a ply of no format": ("e.ply", b"ply\n" + point + b"end_header\n1 1 1", "no format"),
        "a ply of no points": ("e.ply", head + b"end_header\n", "no element vertex"),
        "a ply without z": ("e.ply", head + point[:-17] + b"end_header\n1 1\n", "no property z"),
        "a ply with too few": ("e.ply", head + point + b"end_header\n1 1\n", "cut short"),
        "a ply of words": ("e.ply", head + point + b"end_header\n1 1 two\n", "could not convert"),
        "a ply with nan": ("e.ply", head + point + b"end_header\n1 1 nan\n", "point 0 is at"),
        "a ply that is far": ("e.ply", head + point + b"end_header\n1 1 1e300\n", "finite"),
        "a ply of two x": ("e.ply", head + point.replace(b"t y", b"t x") + b"end_header\n1 1 1\n",
                           "each once"),
        "a ply of many": ("e.ply", binary + point.replace(b"1\n", b"99999999999\n", 1)
                          + b"end_header\n" + bytes(24), "99999999999 of element vertex"),
        "a ply of an endless list": (
            "e.ply", binary + point + b"element face 1\nproperty list uint int vertex_indices\n"
            b"end_header\n" + bytes(12) + b"\xff" * 4, "a list has the length 4294967295"),
        "a ply of many odd lists": (
            "e.ply", head + point + b"element face 9999999\nproperty list uint int vertex_indices\n"
            b"end_header\n1 1 1\n", "at most 4194304"),
        "a ply that names another point": (
            "e.ply", head + point + b"element face 1\nproperty list uchar int vertex_indices\n"
            b"end_header\n1 1 1\n3 0 0 1\n", "a triangle names point 1 of 1"),
        "a ply that names half a point": (
            "e.ply", head + point + b"element face 1\nproperty list uchar int vertex_indices\n"
            b"end_header\n1 1 1\n3 0 0 0.5\n", "no whole number"),
        "a ply of an odd word": ("e.ply", head + b"elment vertex 1\nend_header\n",
                                 "'elment vertex 1' is not understood"),
        "a ply of an odd type": ("e.ply", head + b"element vertex 1\nproperty int7 x\nend_header\n",
                                 "type 'int7' is not known"),
        "a cut ply": ("c.ply", whole[".ply"][:-1], "cut short"),
        "a cut pcd": ("c.pcd", whole[".pcd"][:-1], "cut short: 102 points announced"),
        "a compressed pcd": ("c.pcd", pcd_head + "binary_compressed\n", "expected binary or ascii"),
        "a pcd of words": ("c.pcd", pcd_head + "ascii\na b c\n", "could not convert"),
        "a pcd of too few": ("c.pcd", pcd_head + "ascii\n1 2\n", "cut short"),
        "a pcd of nothing": ("c.pcd", pcd_head + "ascii\nnan 1 1\n", "has no points"),
        "a pcd without data": ("c.pcd", "FIELDS x\n", "no line DATA"),
        "a pcd of odd numbers": ("c.pcd", pcd_head.replace("TYPE F", "TYPE Q") + "binary\n",
                                 "field x of TYPE Q and SIZE 4"),
        "a pcd of y alone": ("c.pcd", pcd_head.replace("x y z", "y y2 z") + "ascii\n1 2 3\n",
                             "has no field x"),
        "a cut stl": ("c.stl", whole[".stl"][:-1], "cut short"),
        "a cut stl of text": ("c.stl", "solid a\nfacet\nvertex 1 2 3\n", "cut short"),
        "an stl of nothing": ("c.stl", "solid a\nendsolid a\n", "has no points"),
        "an obj of nothing": ("c.obj", "# nothing\n", "has no points"),
        "an obj of words": ("c.obj", "v 1 2 3\nv a b c\n", "line 2: could not convert"),
        "an obj of two numbers": ("c.obj", "v 1 2\n", "fewer than 3"),
        "an obj that counts from 0": ("c.obj", "v 1 2 3\nf 0 1 1\n", "names point -1 of 1"),
        "an obj that counts too far back": ("c.obj", "v 1 2 3\nf -9 1 1\n", "names point -1 of 1"),
        "a cut glb": ("c.glb", whole[".glb"][:-4], "cut short"),
        "a glb of version 1": ("c.glb", whole[".glb"][:4] + b"\1" + whole[".glb"][5:], "version 1"),
        "a glb of nothing": ("c.glb", glb({}), "no mesh"),
        "a glb of no object": ("c.glb", struct.pack("<4sIIII2s2x", b"glTF", 2, 24, 4, 0x4E4F534A,
                                                    b"[]"), "double|Extra data|no JSON object"),
        "a glb of draco": ("c.glb", glb({"extensionsRequired": ["KHR_draco_mesh_compression"]}),
                           "needs what is not read: KHR_draco_mesh_compression"),
        "a glb in a circle": ("c.glb", glb({"scenes": [{"nodes": [0]}], "nodes": [
            {"children": [0, 0]}]}), "a circle"),
        "a glb of no node": ("c.glb", glb({"scenes": [{"nodes": [7]}], "nodes": [{}]}),
                             "names nodes 7 of 1"),
        "a glb that leans on nothing": ("c.glb", placed(scale=[1, "x", 1]), "could not convert"),
        "a glb at no place": ("c.glb", placed(translation=[1, 1]), "expected 3 numbers"),
        "a glb of half a document": ("c.glb", glb({"scenes": [{"nodes": [0]}], "nodes": [
            {"mesh": 0}], "meshes": [{"primitives": [{}]}]}), "damaged, or no .glb file"),
        "a glb of deep brackets": ("c.glb", struct.pack(
            "<4sIIII", b"glTF", 2, 20 + 2**20, 2**20, 0x4E4F534A) + b"[" * 2**20, "damaged"),
    }


WRONG = wrong()


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_is_one_clear_line(tmp_path, name):
    file, data, said = WRONG[name]
    path = write(tmp_path, file, data)
    with pytest.raises(FormatError, match=said) as raised:
        read_mesh(path)
    assert str(raised.value).startswith(f"{path}: ")
    assert str(raised.value).isprintable()
    assert len(str(raised.value)) < 400 + len(str(path))


def test_what_is_no_file_is_told(tmp_path):
    for ending in (".ply", ".npz"):
        with pytest.raises(FormatError, match="No such file"):
            read_mesh(tmp_path / f"no{ending}")
    (tmp_path / "folder.ply").mkdir()
    with pytest.raises(FormatError, match="is a folder, expected a file"):
        read_mesh(tmp_path / "folder.ply")
    with pytest.raises(TypeError, match="path: expected str or Path, found int 5"):
        read_mesh(5)


@pytest.mark.parametrize("ending", [".ply", ".pcd", ".obj", ".stl", ".glb", ".compact.glb"])
def test_damage_anywhere_is_a_line_or_another_mesh(tmp_path, ending):
    save_face(small_face(4, 4), tmp_path / f"f{ending}",
              options=OPEN if ending == ".stl" else ExportOptions(compact="compact" in ending))
    whole = (tmp_path / f"f{ending}").read_bytes()
    rng, refused = np.random.default_rng(3), []
    for _ in range(60):
        data = bytearray(whole)
        for place in rng.integers(0, len(data), rng.integers(1, 4)):
            data[place] = rng.integers(0, 256)
        cut = rng.integers(0, len(data)) if rng.random() < 0.3 else len(data)
        path = write(tmp_path, f"d{ending}", bytes(data[:cut]))
        try:
            mesh = read_mesh(path)
        except FormatError as error:
            refused.append(str(error))
            continue
        assert np.isfinite(mesh.points).all()
        assert mesh.triangles is None or mesh.triangles.max() < len(mesh.points)
    assert refused
    assert all(line.isprintable() for line in refused)
