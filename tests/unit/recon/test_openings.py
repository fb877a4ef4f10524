"""Holes left open are counted as the triangles have them, by another way and by Open3D."""

from dataclasses import replace

import numpy as np
import open3d as o3d
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.face import MAX_STEP, DenseCloud
from denseface.recon.openings import openings
from denseface.service.export.mesh import triangulate
from tests.mesh_holes import MeshFaults, mesh_faults
from tests.unit.service.faces import small_face


def without(cloud: DenseCloud, gone: np.ndarray) -> DenseCloud:
    """Take points from a cloud, (n,) bool."""
    kept = {name: getattr(cloud, name)[~gone]
            for name in ("points", "colors", "normals", "sigma", "cells")}
    return replace(cloud, **kept)


def test_a_whole_surface_has_none():
    cloud = small_face().dense
    assert openings(cloud) == (0, (0.0, 0.0))
    assert mesh_faults(cloud.points, triangulate(cloud)) == MeshFaults(0, 0, 0, 0)


def test_holes_are_counted_and_the_longest_is_measured():
    cloud = small_face(40, 30).dense
    row, column = cloud.cells.T
    gone = (((row >= 10) & (row < 13) & (column >= 8) & (column < 20))  # 12 x 3 places of 2 mm
            | ((row == 20) & (column == 20)) | ((row == 21) & (column == 21))  # one, by a corner
            | ((row >= 28) & (column == 5)))  # reaches the outline
    assert openings(without(cloud, gone)) == (2, (26.0, 8.0))


def test_what_meets_the_outside_at_a_corner_is_open_and_no_hole():
    cloud = small_face(40, 30).dense
    row, column = cloud.cells.T
    gone = ((row == 20) & (column == 5)) | ((row == 21) & (column <= 4))
    assert openings(without(cloud, gone)) == (0, (0.0, 0.0))


def test_a_step_within_the_surface_is_a_hole_though_no_point_is_missing():
    cloud = small_face(40, 30, step=0.5).dense
    row, column = cloud.cells.T
    raised = (row > 10) & (row < 20) & (column > 8) & (column < 20)
    points, normals = cloud.points.copy(), cloud.normals.copy()
    points[raised, 2] -= 1.2 * MAX_STEP * cloud.grid_step_mm
    normals[raised] = (1, 0, 0)
    torn = replace(cloud, points=points, normals=normals)
    assert openings(torn).holes == mesh_faults(points, triangulate(torn)).holes == 1


def test_a_corner_at_a_hole_is_no_step_where_the_surface_is_torn_elsewhere():
    cloud = small_face(40, 30, step=0.5).dense
    row, column = cloud.cells.T
    points, normals = cloud.points.copy(), cloud.normals.copy()
    points[row > 30, 2] += 3 * MAX_STEP * cloud.grid_step_mm
    normals[row == 30] = (1, 0, 0)
    torn = without(replace(cloud, points=points, normals=normals), (row == 15) & (column == 12))
    assert openings(torn).holes == mesh_faults(torn.points, triangulate(torn)).holes == 1
    assert openings(torn).largest_mm == openings(
        without(cloud, (row == 15) & (column == 12))).largest_mm


@settings(deadline=None, max_examples=40)
@given(seed=st.integers(0, 999), share=st.floats(0, 0.5))
def test_the_count_is_that_of_the_triangles(seed, share):
    cloud = small_face(16, 14).dense
    cloud = without(cloud, np.random.default_rng(seed).random(len(cloud)) < share)
    triangles = triangulate(cloud)
    if not len(triangles):
        return
    mesh = o3d.geometry.TriangleMesh(
        o3d.utility.Vector3dVector(cloud.points.astype(float)),
        o3d.utility.Vector3iVector(triangles)).remove_unreferenced_vertices()
    faults = mesh_faults(cloud.points, triangles)
    assert mesh.is_edge_manifold() == (faults.non_manifold == 0)
    assert mesh.is_orientable()
    assert faults == MeshFaults(faults.holes, 0, 0, 0)
    _, parts, _ = mesh.cluster_connected_triangles()
    # A part that touches another in a point alone is two to Open3D, and one here.
    assert len(parts) - mesh.euler_poincare_characteristic() >= faults.holes
    assert openings(cloud).holes == faults.holes
