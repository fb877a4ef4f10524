"""What is packed by EXT_meshopt_compression, as meshoptimizer's own decoder unpacks it."""

import base64

import numpy as np
import pytest

from denseface.service.export.models.meshopt import (
    encode_attributes,
    encode_triangles,
    octahedral,
    strip_order,
)
from tests.unit.service.export.models.conftest import meshes_to_pack, rows_to_pack, strip


def test_elements_come_out_as_they_went_in(written):
    rows = rows_to_pack()
    told = written["streams.json"][:len(rows)]
    for given, found in zip(rows, told, strict=True):
        assert base64.b64decode(found) == given.tobytes()


def test_triangles_come_out_as_they_went_in(written):
    meshes = meshes_to_pack()
    told = written["streams.json"][-len(meshes):]
    for given, found in zip(meshes, told, strict=True):
        triangles, order = strip_order(given)
        read = np.frombuffer(base64.b64decode(found), np.uint32).reshape(-1, 3)
        np.testing.assert_array_equal(read, triangles)
        # They are the same, with the same front.
        same = order[triangles]
        turns = [np.roll(given, k, axis=1) for k in range(3)]
        assert (np.array([(same == turn).all(axis=1) for turn in turns]).any(axis=0)).all()


def test_equal_elements_take_next_to_nothing():
    assert len(encode_attributes(np.full((4096, 4), 9, np.uint8))) < 4096 / 256 * 16 + 64


def test_a_grid_takes_little_more_than_a_byte_for_each_triangle():
    triangles, _ = strip_order(strip(100, 100, missing=False))
    assert len(encode_triangles(triangles)) < 1.05 * len(triangles)


def test_points_that_are_not_numbered_as_they_are_met_are_refused():
    with pytest.raises(ValueError, match="not numbered"):
        encode_triangles(np.array([[2, 1, 0]], np.int32))


@pytest.mark.parametrize(("bits", "off_deg"), [(8, 1.0), (10, 0.25)])
def test_normals_of_all_directions_are_taken_back(bits, off_deg):
    """By filter 1 as the extension's appendix B writes it down."""
    normals = np.random.default_rng(0).normal(size=(5000, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    coded = octahedral(normals, bits).astype(np.float64)
    assert np.abs(coded[:, :2]).max() <= coded[0, 2] == (1 << (bits - 1)) - 1
    x, y = coded[:, 0] / coded[:, 2], coded[:, 1] / coded[:, 2]
    z = 1 - np.abs(x) - np.abs(y)
    t = np.minimum(z, 0)
    read = np.stack([x - np.copysign(t, x), y - np.copysign(t, y), z], axis=1)
    read /= np.linalg.norm(read, axis=1, keepdims=True)
    assert np.einsum("ix,ix->i", read, normals).min() > np.cos(np.deg2rad(off_deg))
