"""A dense cloud packed and unpacked."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from denseface.recon.face import DenseCloud
from denseface.service.protocol._packing_kernels import to_float16_bits
from denseface.service.protocol.packing import pack, unpack


def cloud(rows=13, columns=21, share=0.5, seed=0, slope=3.0):
    """Points at random places of a grid, with normals and errors of all sizes."""
    rng = np.random.default_rng(seed)
    cells = np.argwhere(rng.random((rows, columns)) < share).astype(np.int32)
    xs, ys = (rng.normal() * 100 + np.arange(n) * 0.4783 for n in (columns, rows))
    z = rng.uniform(400, 2000, len(cells))
    points = np.column_stack([xs[cells[:, 1]], ys[cells[:, 0]], z]).astype(np.float32)
    normals = np.column_stack([rng.normal(size=(len(cells), 2)) * slope, -np.ones(len(cells))])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return DenseCloud(
        points, rng.integers(0, 256, (len(cells), 3), np.uint8), normals.astype(np.float32),
        np.exp(rng.uniform(-3, 3, len(cells))).astype(np.float32), cells, (rows, columns), 0.4783)


@given(st.integers(1, 40), st.integers(1, 40), st.sampled_from([0, 0.02, 0.5, 1]),
       st.sampled_from([0, 0.5, 5, 500]), st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_what_is_packed_comes_back(rows, columns, share, slope, seed):
    before = cloud(rows, columns, share, seed, slope)
    after = unpack(pack(before))
    for name in ("points", "colors", "cells"):
        np.testing.assert_array_equal(getattr(after, name), getattr(before, name))
    np.testing.assert_allclose(after.sigma, before.sigma, rtol=2**-11)
    assert (after.grid_shape, after.grid_step_mm) == (before.grid_shape, before.grid_step_mm)
    np.testing.assert_allclose(np.linalg.norm(after.normals, axis=1), 1, atol=2e-7)
    np.testing.assert_allclose(after.normals[:, :2], before.normals[:, :2], atol=0.75 / 32767)


def test_normals_are_of_unit_length_whatever_is_in_them():
    packed = pack(cloud())
    packed.normals[:4] = [[32767, 200], [-32768, -32768], [0, 32767], [23171, -23170]]
    normals = unpack(packed).normals
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1, atol=2e-7)
    assert (normals[:, 2] <= 0).all()


def test_normals_are_off_by_thousandths_of_a_degree():
    before = cloud(60, 80, 1, slope=1.5)
    after = unpack(pack(before))
    sine = np.linalg.norm(np.cross(before.normals.astype(float), after.normals), axis=1)
    steep = before.normals[:, 2] > -0.25
    assert steep.any()
    assert np.degrees(np.arcsin(sine[~steep])).max() < 0.006
    assert np.median(np.degrees(np.arcsin(sine))) < 0.002


def test_a_third_of_the_bytes():
    before = cloud(100, 100, 0.8)
    packed = pack(before)
    size, was = (sum(value.nbytes for value in vars(one).values() if isinstance(value, np.ndarray))
                 for one in (packed, before))
    assert size < 0.36 * was


def test_what_is_packed_again_is_the_same():
    once = pack(cloud())
    twice = pack(unpack(once))
    for name in ("support", "x", "y", "z", "colors", "normals", "sigma"):
        np.testing.assert_array_equal(getattr(once, name), getattr(twice, name))


def moved(before):
    before.points[7, 0] += 0.01
    return before


def lifted(before):
    before.points[7, 1] += 0.01
    return before


def swapped(before):
    order = np.arange(len(before))
    order[[7, 8]] = 8, 7
    return DenseCloud(before.points[order], before.colors, before.normals, before.sigma,
                      before.cells[order], before.grid_shape, before.grid_step_mm)


def doubled(before):
    before.cells[7], before.points[7] = before.cells[6], before.points[6]
    return before


def turned(before):
    before.normals[7] *= -1
    return before


@pytest.mark.parametrize("spoil", [moved, lifted, swapped, doubled, turned])
def test_a_cloud_that_is_no_grid_is_refused(spoil):
    with pytest.raises(ValueError, match=r"point \d+ is not at its place on a grid"):
        pack(spoil(cloud()))


@pytest.mark.parametrize("sigma", [1e-9, 1e6])
def test_an_error_beyond_sixteen_bits_is_refused(sigma):
    before = cloud()
    before.sigma[3] = sigma
    with pytest.raises(ValueError, match=r"sigma must be within 0\.0001 and 65000 mm"):
        pack(before)


@given(st.lists(st.floats(2**-13, 65e3, width=32), min_size=1, max_size=50))
@example([2**-13 * (1 + n / 4096) for n in range(17)])
def test_errors_are_rounded_as_numpy_rounds_them(values):
    sigma = np.array(values, np.float32)
    np.testing.assert_array_equal(
        to_float16_bits(sigma.view(np.uint32)).view(np.float16), sigma.astype(np.float16))


@pytest.mark.parametrize(("name", "value", "words"), [
    ("x", np.nan, "x must be finite"), ("y", np.inf, "y must be finite"),
    ("z", -np.inf, "z must be finite"), ("sigma", -1, "sigma must be"),
    ("sigma", np.inf, "sigma must be"), ("sigma", 0, "sigma must be"),
    ("support", 255, "support must lie on the \\(13, 21\\) grid"),
    ("support", 0, "support has 0 places for"),
])
def test_what_no_cloud_packs_to_is_refused(name, value, words):
    packed = pack(cloud())
    with pytest.raises(ValueError, match=words):
        replace(packed, **{name: np.full_like(getattr(packed, name), value)})
