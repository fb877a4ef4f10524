"""A face bulges toward the camera, a wall does not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.detection._kernels import depths_in_box
from denseface.recon.detection._relief import bulge_mm, bulging_cells, fit_bulge
from denseface.recon.registration import register
from tests.unit.frames import calibration, camera, frame

BOX = (60, 40, 40, 40)
GRAY = np.full((120, 160, 3), 128, np.uint8)

SHAPE = 30, 40
EVERYWHERE = np.ones(SHAPE, np.bool_)
# Half a box is 6 cells at 700 mm.
HALF = 6.0 * 700


def bulge(depth):
    shown = frame(np.rint(depth).astype(np.uint16), GRAY,
                  calibration(depth=camera(), color=camera()), registered=True)
    one = register(shown)
    return bulge_mm(depths_in_box(one.pixels, one.color_depth, one.visible, *map(float, BOX)),
                    700.0)


def plane(across=0.0, down=0.0):
    v, u = np.mgrid[:120, :160]
    return 700 + across * (u - 80) + down * (v - 60)


@settings(deadline=None)
@given(st.floats(-2, 2), st.floats(-2, 2))
def test_a_plane_has_none_however_slanted(across, down):
    assert abs(bulge(plane(across, down))) < 1


@pytest.mark.parametrize("drop", [-40, -10, 10, 40])
def test_it_is_how_far_the_sides_lie_behind_the_middle(drop):
    v, u = np.mgrid[:120, :160]
    depth = plane(0.5) + drop * ((u - 79.5) ** 2 + (v - 59.5) ** 2) / 20**2
    assert bulge(depth) == pytest.approx(drop, abs=1)


def test_what_is_far_behind_the_head_does_not_count():
    depth = plane()
    depth[:, 72:] = 1200
    assert abs(bulge(depth)) < 1


def test_a_few_depths_do_not_tell():
    depth = np.zeros((120, 160))
    depth[58:61, 78:81] = 700
    assert bulge(depth) == np.inf


def test_a_hand_before_the_chin_does_not_flatten_a_face():
    v, u = np.mgrid[:120, :160]
    depth = plane() + 30 * ((u - 79.5) ** 2 + (v - 59.5) ** 2) / 20**2
    depth[72:90, 66:94] = 655
    assert bulge(depth) == pytest.approx(30, abs=3)


def test_no_depth_does_not_tell():
    assert bulge(np.where(plane() > 0, 1200, 0) * (np.arange(160) < 40)) == np.inf


def bowl(rise_mm):
    """That much nearer in the middle than 6 cells aside."""
    v, u = np.mgrid[:SHAPE[0], :SHAPE[1]]
    return (700 + rise_mm * ((u - 20) ** 2 + (v - 15) ** 2) / 36).astype(np.float32)


@pytest.mark.parametrize(("rise_mm", "kept"), [(12, True), (6, True), (2, False), (-10, False)])
def test_a_cell_is_kept_where_depth_bulges_enough(rise_mm, kept):
    assert bulging_cells(bowl(rise_mm), EVERYWHERE, HALF, 4.0)[15, 20] == kept


def test_only_allowed_cells_are_given():
    allowed = np.zeros(SHAPE, np.bool_)
    allowed[15, 20] = True
    assert np.array_equal(bulging_cells(bowl(12), allowed, HALF, 4.0), allowed)


def test_a_cell_without_depth_cannot_tell():
    nearest = np.full(SHAPE, 1e30, np.float32)
    assert bulging_cells(nearest, EVERYWHERE, HALF, 4.0).all()


def test_depths_along_a_line_give_no_nonsense():
    u = np.linspace(-0.9, 0.9, 40)
    bulge, known = fit_bulge(np.stack([u, 0 * u, 700 + 0 * u], axis=1), 700.0)
    assert known
    assert abs(bulge) < 1e-3
