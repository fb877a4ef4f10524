"""A face bulges toward the camera, a wall does not."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.detection._kernels import depths_in_box
from denseface.recon.detection._relief import bulge_mm
from denseface.recon.registration import register
from tests.unit.frames import calibration, camera, frame

BOX = (60, 40, 40, 40)
GRAY = np.full((120, 160, 3), 128, np.uint8)


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
