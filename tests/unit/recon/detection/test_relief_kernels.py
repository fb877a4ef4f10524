"""Where depth bulges, cell by cell."""

import numpy as np
import pytest

from denseface.recon.detection._relief_kernels import curved_cells, fitted_bulge

SHAPE = 30, 40
ANYWHERE = np.ones(SHAPE, np.bool_)
# Half a box is 6 cells at 700 mm.
HALF = 6.0 * 700


def bowl(rise_mm):
    """That much nearer in the middle than 6 cells aside."""
    v, u = np.mgrid[:SHAPE[0], :SHAPE[1]]
    return (700 + rise_mm * ((u - 20) ** 2 + (v - 15) ** 2) / 36).astype(np.float32)


@pytest.mark.parametrize(("rise_mm", "kept"), [(12, True), (6, True), (2, False), (-10, False)])
def test_a_cell_is_kept_where_depth_bulges_enough(rise_mm, kept):
    assert curved_cells(bowl(rise_mm), ANYWHERE, HALF, 4.0)[15, 20] == kept


def test_only_wanted_cells_are_given():
    wanted = np.zeros(SHAPE, np.bool_)
    wanted[15, 20] = True
    assert np.array_equal(curved_cells(bowl(12), wanted, HALF, 4.0), wanted)


def test_a_cell_without_depth_can_not_tell():
    nearest = np.full(SHAPE, 1e30, np.float32)
    assert curved_cells(nearest, ANYWHERE, HALF, 4.0).all()


def test_depths_along_a_line_give_no_nonsense():
    u = np.linspace(-0.9, 0.9, 40)
    bulge, known = fitted_bulge(np.stack([u, 0 * u, 700 + 0 * u], axis=1), 700.0)
    assert known
    assert abs(bulge) < 1e-3
