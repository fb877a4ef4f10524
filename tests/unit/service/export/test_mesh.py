"""Meshes straight from the grid: which points are joined, and what is done about holes."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.recon.face import DenseCloud
from denseface.service.errors import UsageError
from denseface.service.export import ExportOptions
from denseface.service.export.mesh import LONGEST_EDGE, face_mesh, local_spacing, triangulate
from denseface.service.export.models.holes import without_holes
from tests.mesh_holes import mesh_faults
from tests.unit.service.export.models.conftest import dome, sample_cloud
from tests.unit.service.faces import small_face


def surface(depth, slope, rows=20, columns=30, step=0.5):
    """A cloud whose depth and slope along x are functions of x, mm."""
    v, u = (one.ravel() for one in np.mgrid[:rows, :columns])
    x, y = u * step, v * step
    normals = np.stack([slope(x), np.zeros(len(x)), -np.ones(len(x))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return DenseCloud(
        np.stack([x, y, 700 + depth(x)], axis=1).astype(np.float32),
        np.full((len(x), 3), 90, np.uint8), normals.astype(np.float32),
        np.ones(len(x), np.float32), np.stack([v, u], axis=1).astype(np.int32), (rows, columns),
        step)


def edges(cloud, triangles):
    """Lengths of edges, and what each may be at most."""
    pairs = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    corners = cloud.points[pairs].astype(float)
    spacing = local_spacing(cloud)[pairs].max(axis=1)
    return np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1), LONGEST_EDGE * spacing


def test_a_steep_side_of_a_nose_is_whole():
    """Of 78 degrees: each step to the right is 4.9 steps in depth."""
    cloud = surface(lambda x: 4.8 * np.abs(x - 7), lambda x: 4.8 * np.sign(x - 7))
    triangles = triangulate(cloud)
    assert len(triangles) == 2 * 19 * 29
    assert mesh_faults(cloud.points, triangles).holes == 0
    lengths, limits = edges(cloud, triangles)
    assert (lengths <= limits).all()
    assert lengths.max() > 4 * cloud.grid_step_mm


@pytest.mark.parametrize("gap", [2.0, 6.0, 30.0])
def test_two_surfaces_are_not_joined(gap):
    """A nose before a cheek: both look at the camera, and nothing is between them."""
    cloud = surface(lambda x: gap * (x > 7.2), np.zeros_like)
    triangles = triangulate(cloud)
    left = cloud.points[triangles][:, :, 0] < 7.2
    assert (left.all(axis=1) | ~left.any(axis=1)).all()
    assert len(triangles) == 2 * 19 * 28


def test_the_spacing_is_a_grid_step_over_the_cosine_of_the_slope():
    flat, steep = surface(np.zeros_like, np.zeros_like), surface(lambda x: 3 * x, lambda x: 3 + 0*x)
    assert local_spacing(flat) == pytest.approx(0.5)
    assert local_spacing(steep) == pytest.approx(0.5 * np.sqrt(10))


def test_blocks_are_joined_along_the_shorter_diagonal():
    cloud = surface(np.zeros_like, np.zeros_like, 2, 2)
    for row, diagonal in ((0, {1, 2}), (1, {0, 3})):
        points = cloud.points.copy()
        points[row, 2] += 0.3
        first, second = triangulate(replace(cloud, points=points))
        assert set(first) & set(second) == diagonal


def test_a_real_mesh_is_sound():
    cloud = sample_cloud()
    mesh = face_mesh(cloud)
    triangles = triangulate(cloud)
    faults = mesh_faults(mesh.points, mesh.triangles)
    assert (faults.non_manifold, faults.flipped, faults.degenerate) == (0, 0, 0)
    lengths, limits = edges(cloud, triangles)
    assert (lengths <= limits).all()
    assert len(np.unique(mesh.triangles)) == len(mesh.points)
    # Hardly a point is lost: those of a rim that folds away from the camera.
    assert len(cloud) - len(mesh.points) < 0.001 * len(cloud)
    a, b, c = np.moveaxis(mesh.points[mesh.triangles], 1, 0)
    assert (np.cross(b - a, c - a)[:, 2] < 0).all()


def test_points_of_no_triangle_are_left_out():
    cloud = small_face().dense
    points = cloud.points.copy()
    points[40, 2] += 200
    mesh = face_mesh(replace(cloud, points=points))
    assert len(mesh.points) == len(cloud) - 1
    assert mesh_faults(mesh.points, mesh.triangles).holes == 1


def test_a_face_without_neighbours_has_no_mesh():
    with pytest.raises(UsageError, match="no three of its points are neighbours"):
        face_mesh(small_face(3, 3).dense)


def test_holes_are_left_or_closed():
    cloud = dome().dense
    left, closed = (face_mesh(cloud, ExportOptions(holes=holes)) for holes in ("leave", "close"))
    assert mesh_faults(left.points, left.triangles).holes == 1
    assert mesh_faults(closed.points, closed.triangles).holes == 0
    whole = without_holes(cloud)
    new = {tuple(cell) for cell in whole.cells} - {tuple(cell) for cell in cloud.cells}
    assert len(new) == len(whole) - len(cloud) > 15
    # The membrane is near the dome, which it cuts off.
    x, y, z = whole.points.T
    assert np.abs(z - (700 + (x**2 + y**2) / 80)).max() < 0.15
    assert (np.diff(whole.cells[:, 0] * 1000 + whole.cells[:, 1]) > 0).all()
    assert np.linalg.norm(whole.normals, axis=1) == pytest.approx(1, abs=1e-5)
    kept = np.isin(whole.cells[:, 0] * 1000 + whole.cells[:, 1],
                   cloud.cells[:, 0] * 1000 + cloud.cells[:, 1])
    np.testing.assert_array_equal(whole.points[kept], cloud.points)
    np.testing.assert_array_equal(whole.colors[kept], cloud.colors)


def test_what_has_no_holes_is_given_back():
    cloud = small_face().dense
    assert without_holes(cloud) is cloud
