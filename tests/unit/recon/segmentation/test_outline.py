"""What stays at a face's outline, on masks whose widths are known."""

import numpy as np
import pytest

from denseface.recon.segmentation._outline import smooth_outline
from tests.simulator.noise import _field

V, U = np.mgrid[:260, :220].astype(float)
MIDDLE = (140, 110)
FACE = np.hypot((U - MIDDLE[1]) / 70, (V - MIDDLE[0]) / 90) < 1
BROW = 80
"""Row that the hair begins above, pixels and mm."""


def kept(face, px_per_mm=1.0):
    return face & smooth_outline(face, np.zeros(face.shape, bool), MIDDLE, 50 * px_per_mm,
                                 px_per_mm)


def comb(width, gap):
    """The face with teeth on the forehead, whose gaps are closed as bays are."""
    teeth = (V > 40) & (V < BROW) & (np.abs(U - MIDDLE[1]) < 40)
    face = FACE & (V > BROW)
    return face, teeth & ((U - MIDDLE[1] + 40) % (width + gap) < width)


@pytest.mark.parametrize(("width", "stay"), [(3, False), (4, False), (12, True)])
def test_strands_go_and_what_is_broad_stays(width, stay):
    face, teeth = comb(width, 5)
    found = kept(face | teeth)
    far = teeth & (V < BROW - 8)
    assert found[far].mean() > 0.85 if stay else not found[far].any()
    assert found[face].mean() > 0.99


@pytest.mark.parametrize("px_per_mm", [0.6, 1.0])
def test_hair_of_which_little_is_measured_goes(px_per_mm):
    patchy = _field(FACE.shape, 1.5, np.random.default_rng(1)) > 0.4  # a third, in clumps
    hair = (np.hypot(U - MIDDLE[1], V - 100) < 85) & (V < BROW)
    skin = FACE & (V > BROW)
    found = kept(skin | (hair & patchy), px_per_mm)
    assert found[hair & patchy & (V < BROW - 8)].mean() < 0.15
    assert found[skin].mean() > 0.99


def test_patches_without_readings_inside_a_face_cost_nothing():
    holes = np.zeros_like(FACE)
    for row, column, radius in ((110, 80, 12), (110, 140, 14), (150, 110, 8), (200, 110, 10)):
        holes |= np.hypot(U - column, V - row) < radius
    np.testing.assert_array_equal(kept(FACE & ~holes), kept(FACE) & ~holes)


def test_an_even_outline_is_left_as_it_is():
    assert kept(FACE)[FACE].mean() > 0.998


def test_what_hangs_from_the_chin_by_a_few_readings_goes():
    throat = (np.abs(U - MIDDLE[1]) < 5) & (V > 200) & (V < 258)
    assert not kept(FACE | throat)[throat & (V > 234)].any()


@pytest.mark.parametrize("share", [0.2, 0.5, 0.8])
def test_readings_that_are_few_everywhere_are_no_hair(share):
    face = FACE & (np.random.default_rng(2).random(FACE.shape) < share)
    assert kept(face)[face].mean() > 0.9
