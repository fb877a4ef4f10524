"""The files that are printed, read by others: trimesh, and lib3mf of the 3MF consortium."""

import io
import zipfile
from dataclasses import replace

import lib3mf
import numpy as np
import pytest
import trimesh
from PIL import Image

from denseface.recon.face import Face
from denseface.service.errors import UsageError
from denseface.service.export import save_face
from denseface.service.export.options import ExportOptions
from denseface.service.export.printing import Printing
from denseface.service.export.printing.solid import make_solid
from denseface.service.export.printing.stl import to_stl
from denseface.service.export.printing.threemf import NAMESPACE, to_3mf
from denseface.service.export.provenance import provenance
from denseface.service.export.reading import read_mesh
from tests.unit.service.faces import small_face


def face(**told: str) -> Face:
    made = small_face(24, 18)
    return replace(made, report=made.report.model_copy(update=told))


@pytest.fixture(scope="module", params=["plate", "mask"])
def printing(request) -> Printing:
    return Printing(solid=request.param, height_mm=40.0)


def test_stl_is_the_solid_with_its_unit_and_where_it_comes_from(printing):
    data = to_stl(face(source="take.oni#3"), ExportOptions(printing=printing))
    assert data.startswith(b"by denseface, mm, z up; take.oni#3")
    mesh = trimesh.load(io.BytesIO(data), file_type="stl")
    solid = make_solid(face().dense, printing)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(trimesh.Trimesh(
        solid.points, solid.triangles, process=False).volume, rel=1e-5)
    assert (len(mesh.vertices), len(mesh.faces)) == (len(solid.points), len(solid.triangles))
    stored = np.frombuffer(data[84:], np.dtype(
        [("normal", "<f4", 3), ("corners", "<f4", 9), ("attributes", "<u2")]))["normal"]
    a, b, c = np.moveaxis(solid.points[solid.triangles].astype(float), 1, 0)
    normals = np.cross(b - a, c - a)
    assert (stored * normals).sum(axis=1) == pytest.approx(np.linalg.norm(normals, axis=1))


@pytest.mark.parametrize("solid", ["plate", "mask"])
def test_a_printed_stl_is_read_back_upright_and_from_the_front(solid, tmp_path):
    made = face()
    save_face(made, tmp_path / "a.stl", options=ExportOptions(printing=Printing(solid)))
    read = read_mesh(tmp_path / "a.stl").points
    stands = make_solid(made.dense, Printing(solid)).points
    assert np.unique(read, axis=0) == pytest.approx(
        np.unique(stands * np.float32([1, -1, -1]), axis=0), abs=1e-4)


def test_stl_may_be_the_open_surface_of_the_camera():
    data = to_stl(face(), ExportOptions(printing=Printing(solid="open")))
    mesh = trimesh.load(io.BytesIO(data), file_type="stl")
    assert not mesh.is_watertight
    assert mesh.bounds == pytest.approx(np.array(
        [face().dense.points.min(axis=0), face().dense.points.max(axis=0)]), abs=2.1)


def test_3mf_is_read_in_strict_mode_without_a_warning(printing, tmp_path):
    made = face(source="take.oni#3", sensor='"A" & <B>\n\x07\ud800é', capture_id="visit-7")
    made = replace(made, report=made.report.model_copy(update={"sensor": '"A" & <B>\x07 é'}))
    path = tmp_path / "face.3mf"
    path.write_bytes(to_3mf(made, ExportOptions(printing=printing)))
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(path))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    meshes, groups = model.GetMeshObjects(), model.GetColorGroups()
    assert meshes.MoveNext()
    mesh = meshes.GetCurrentMeshObject()
    assert mesh.IsManifoldAndOriented()
    assert mesh.IsValid()
    solid = make_solid(made.dense, printing)
    points = np.array([list(one.Coordinates) for one in mesh.GetVertices()])
    triangles = np.array([list(one.Indices) for one in mesh.GetTriangleIndices()])
    assert np.abs(points - solid.points).max() < 1e-4
    assert (triangles == solid.triangles).all()

    assert groups.MoveNext()
    group = groups.GetCurrentColorGroup()
    known = {number: group.GetColor(number) for number in group.GetAllPropertyIDs()}
    for row in range(0, len(triangles), 37):
        for corner, number in enumerate(mesh.GetTriangleProperties(row).PropertyIDs):
            color = known[number]
            assert [color.Red, color.Green, color.Blue, color.Alpha] == [
                *solid.colors[solid.paint[row, corner]], 255]

    told = model.GetMetaDataGroup()
    found = {(one.GetNameSpace(), one.GetName()): one.GetValue() for one in (
        told.GetMetaData(number) for number in range(told.GetMetaDataCount()))}
    expected = provenance(made.report) | {"sensor": '"A" & <B>  é'}
    assert found.pop(("", "Title")) == "Face"
    assert found.pop(("", "Application")) == expected.pop("generator")
    assert found == {(NAMESPACE, name): text for name, text in expected.items()}
    assert model.HasPackageThumbnailAttachment()


def test_3mf_has_the_same_bytes_each_time_and_a_picture():
    first = to_3mf(face())
    assert first == to_3mf(face())
    with zipfile.ZipFile(io.BytesIO(first)) as archive:
        assert archive.testzip() is None
        picture = Image.open(io.BytesIO(archive.read("Metadata/thumbnail.png")))
        assert picture.size == (256, 256)


def test_3mf_is_read_by_trimesh_too(printing):
    data = to_3mf(face(), ExportOptions(printing=printing))
    scene = trimesh.load(io.BytesIO(data), file_type="3mf")
    mesh, = scene.geometry.values()
    assert mesh.is_watertight
    assert mesh.volume > 0
    assert scene.units == "millimeter"


def test_3mf_holds_no_open_surface():
    with pytest.raises(UsageError, match="solid: expected plate or mask, found open"):
        to_3mf(face(), ExportOptions(printing=Printing(solid="open")))
