"""Solids for printing: closed and oriented for two libraries, on whatever outline."""

from dataclasses import replace

import manifold3d
import numpy as np
import pytest
import trimesh
from scipy.spatial import Delaunay

from denseface.recon.face import DenseCloud
from denseface.service.errors import FormatError, UsageError
from denseface.service.export.printing import Printing
from denseface.service.export.printing.solid import Solid, make_solid
from tests.unit.service.faces import small_face

STEP = 1.0
MARGIN, RISE = 5.0, 1.0


def cloud(mask: np.ndarray, depth: float = 60.0, step: float = STEP) -> DenseCloud:
    """A dome of this depth over a grid's places."""
    v, u = np.nonzero(mask)
    rows, columns = mask.shape
    x, y = (u - (columns - 1) / 2) * step, (v - (rows - 1) / 2) * step
    reach = np.hypot(columns, rows) * step / 2
    z = 700 + depth * (x * x + y * y) / reach**2
    points = np.stack([x, y, z], axis=1).astype(np.float32)
    normals = np.tile(np.float32([0, 0, -1]), (len(points), 1))
    colors = np.stack([u * 255 // columns, v * 255 // rows, np.full_like(u, 90)], axis=1)
    return DenseCloud(points, colors.astype(np.uint8), normals, np.ones(len(points), np.float32),
                      np.stack([v, u], axis=1).astype(np.int32), (rows, columns), step)


def disc(rows: int = 60, columns: int = 46) -> np.ndarray:
    v, u = np.mgrid[:rows, :columns]
    return ((v - rows / 2 + 0.5) / (rows / 2)) ** 2 + ((u - columns / 2 + 0.5)
                                                       / (columns / 2)) ** 2 <= 1


def awkward() -> dict[str, np.ndarray]:
    """Supports that would give edges of three triangles, and points that hold two parts."""
    rng = np.random.default_rng(5)
    holes, tongues, islands, corner, hole, ring = (disc() for _ in range(6))
    holes &= rng.random(holes.shape) > 0.3
    tongues[:, ::5] = True
    tongues[::7] = True
    islands[28:31] = False
    islands[5:9, 2:4] = True
    corner[:30, 23:] = False
    corner[30:, :23] = False
    hole[20:40, 15:30] = False
    hole[19, 30] = False
    ring[8:52, 8:38] = False
    ring[52:, 20] = False
    edge = np.ones((40, 40), np.bool_)
    return {"holes": holes, "tongues": tongues, "islands": islands, "corner": corner,
            "hole": hole, "open ring": ring, "edge of the grid": edge,
            "noise": rng.random((50, 50)) > 0.4}


def check(solid: Solid) -> trimesh.Trimesh:
    """Check what a printer needs by trimesh, and by the library of the slicers' kind."""
    mesh = trimesh.Trimesh(solid.points, solid.triangles, process=False)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.area_faces.min() > 0
    assert mesh.body_count == 1
    assert manifold3d.Manifold(manifold3d.Mesh(
        solid.points, solid.triangles.astype(np.uint32))).status() == manifold3d.Error.NoError
    assert mesh.bounds[0] == pytest.approx([0, 0, 0], abs=1e-4), "it is beside the bed"
    # No point holds two parts: around each, the triangles are one fan.
    edges = np.sort(mesh.edges, axis=1)
    assert len(mesh.vertices) - len(np.unique(edges, axis=0)) + len(mesh.faces) == (
        mesh.euler_number)
    assert solid.paint.max() < len(solid.colors)
    return mesh


@pytest.mark.parametrize("name", list(awkward()))
@pytest.mark.parametrize("kind", ["plate", "mask"])
def test_a_solid_is_manifold_on_any_support(name, kind):
    mesh = check(make_solid(cloud(awkward()[name]), Printing(solid=kind)))
    assert mesh.euler_number == 2, "a hole goes through it"


@pytest.mark.parametrize("kind", ["plate", "mask"])
def test_steps_in_depth_are_walls(kind):
    face = cloud(disc())
    torn = face.points.copy()
    torn[face.cells[:, 1] >= 23, 2] += 40
    torn[(face.cells[:, 0] > 20) & (face.cells[:, 0] < 24), 2] -= 30
    check(make_solid(replace(face, points=torn), Printing(solid=kind)))


def test_a_plate_has_its_face_life_size_above_it():
    face = cloud(disc())
    mesh = check(make_solid(face, Printing(wall_mm=3.0)))
    wide, high, deep = np.ptp(face.points, axis=0)
    assert mesh.extents[:2] == pytest.approx([wide + 2 * MARGIN, high + 2 * MARGIN], abs=2.0)
    assert mesh.extents[2] == pytest.approx(3.0 + RISE + deep, abs=0.6)
    # Its back is flat, and as large as all that looks up.
    flat = np.isclose(mesh.triangles[:, :, 2], 0).all(axis=1)
    up = np.maximum(mesh.face_normals[:, 2], 0) @ mesh.area_faces
    assert mesh.area_faces[flat].sum() == pytest.approx(up, rel=1e-6)
    points = mesh.vertices[np.unique(mesh.faces[mesh.face_normals[:, 2] > 0.05])]
    for x, y in ((0, 0), (12, 5), (-10, -20), (3, 24)):
        at = mesh.extents / 2 + [x, y, 0]
        nearest = points[np.linalg.norm(points[:, :2] - at[:2], axis=1).argmin()]
        expected = 60 * (x * x + y * y) / (np.hypot(46, 60) / 2) ** 2
        assert mesh.extents[2] - nearest[2] == pytest.approx(expected, abs=2.0)


def test_a_face_is_upright_and_not_mirrored():
    """The camera's left is at the left and the forehead at the back, seen from above the bed."""
    mask = disc()
    mask[:20, 23:] = False  # what is missing is at the upper right for the camera
    for kind in ("plate", "mask"):
        solid = make_solid(cloud(mask, depth=5.0), Printing(solid=kind))
        mesh = check(solid)
        middle = mesh.extents / 2
        front = (mesh.face_normals[:, 2] > 0.5) & (solid.colors[solid.paint][:, :, 2] == 90).all(
            axis=1)
        centers = mesh.triangles_center[front] - middle
        assert not ((centers[:, 0] > 3) & (centers[:, 1] > 13)).any()
        assert ((centers[:, 0] < -3) & (centers[:, 1] > 13)).any()
        # Red grows to the camera's right, green downward.
        red, green, _ = solid.colors[solid.paint][front].mean(axis=1).T
        assert np.corrcoef(red, centers[:, 0])[0, 1] > 0.99
        assert np.corrcoef(green, centers[:, 1])[0, 1] < -0.99


@pytest.mark.parametrize("wall", [0.8, 2.0, 5.0])
def test_a_mask_is_as_thick_as_asked_everywhere(wall):
    solid = make_solid(cloud(disc(), depth=80.0), Printing(solid="mask", wall_mm=wall))
    mesh = check(solid)
    painted = (solid.colors[solid.paint][:, :, 2] == 90).all(axis=1)
    back = np.unique(mesh.faces[~painted])
    front = trimesh.Trimesh(mesh.vertices, mesh.faces[
        painted & ~np.isin(mesh.faces, back).any(axis=1)], process=False)
    _, distances, _ = trimesh.proximity.closest_point_naive(front, mesh.vertices[back][::70])
    assert distances.min() > 0.93 * wall
    assert np.median(distances) == pytest.approx(wall, rel=0.03)


def test_a_mask_rests_where_it_cannot_tip_over():
    face = cloud(disc())
    tilted = face.points.copy()
    tilted[:, 2] += 0.4 * tilted[:, 1]
    mesh = check(make_solid(replace(face, points=tilted), Printing(solid="mask")))
    touching = mesh.vertices[mesh.vertices[:, 2] < 1e-3, :2]
    assert len(touching) >= 3
    assert Delaunay(touching).find_simplex(mesh.center_mass[:2]) >= 0


@pytest.mark.parametrize("kind", ["plate", "mask"])
@pytest.mark.parametrize("height", [20.0, 60.0])
def test_a_face_is_printed_as_high_as_asked(kind, height):
    mesh = check(make_solid(cloud(disc(), depth=1.0), Printing(solid=kind, height_mm=height)))
    assert mesh.extents[1] == pytest.approx(height + 2 * MARGIN * (kind == "plate"), abs=0.7)
    if kind == "plate":
        assert mesh.extents[2] == pytest.approx(2.0 + RISE + height / 60, abs=0.6)


def test_what_is_too_small_to_be_printed_is_said():
    mask = np.zeros((40, 40), np.bool_)
    mask[20] = True
    for face in (cloud(mask), replace(cloud(disc()), **{
            name: getattr(cloud(disc()), name)[:0]
            for name in ("points", "colors", "normals", "sigma", "cells")})):
        with pytest.raises(FormatError, match="no part of the face is wide enough"):
            make_solid(face, Printing())
    deep = cloud(disc())
    with pytest.raises(FormatError, match="mm deep cannot be printed"):
        make_solid(replace(deep, points=deep.points * np.float32([1, 1, 200])), Printing())


def test_a_grid_of_few_points_is_printed_too():
    for kind in ("plate", "mask"):
        check(make_solid(small_face().dense, Printing(solid=kind)))


@pytest.mark.parametrize(("given", "said"), [
    ({"solid": "ball"}, "solid: expected plate, mask or open, found str 'ball'"),
    ({"wall_mm": 0.1}, "wall_mm: expected millimetres from 0.8 to 10, found float 0.1"),
    ({"wall_mm": float("nan")}, "wall_mm: expected millimetres"),
    ({"wall_mm": "2"}, "wall_mm: expected millimetres"),
    ({"height_mm": 5000}, "height_mm: expected millimetres from 10 to 500, found int 5000"),
    ({"height_mm": True}, "height_mm: expected millimetres"),
    ({"solid": "open", "wall_mm": 3.0}, "expected with a plate or a mask"),
])
def test_what_cannot_be_printed_is_refused(given, said):
    with pytest.raises(UsageError, match=said):
        Printing(**given)
