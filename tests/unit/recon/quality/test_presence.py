"""Whether somebody may be there, by depth alone."""

import numpy as np
import pytest

from denseface.capture.frame import DepthMeaning
from denseface.recon.quality._presence import SparseDepth
from tests.unit.frames import camera, frame

FAR, PERSON = 2000, 800


def look(*boxes, unit_um=1000, far=FAR):
    """Boxes of (rows, columns, mm) before a wall."""
    depth = np.full((120, 160), far, np.float64)
    for rows, columns, mm in boxes:
        depth[rows, columns] = mm
    cam = camera()
    counts = (depth * 1000 / unit_um).astype(np.uint16)
    return SparseDepth.of(frame(counts, np.zeros((120, 160, 3), np.uint8),
                                depth_meaning=DepthMeaning(unit_um=unit_um))), cam


HEAD = np.s_[40:80], np.s_[60:100]


@pytest.mark.parametrize(("mm", "somebody"), [(399, False), (420, False), (PERSON, True),
                                              (1290, True), (1310, False)])
def test_only_what_is_near_enough_and_large_enough_counts(mm, somebody):
    # 40 pixels are 107 mm at 0.4 m.
    assert look((*HEAD, mm))[0].somebody is somebody


def test_the_area_is_that_of_the_thing():
    found, cam = look((*HEAD, PERSON))
    assert found.area_mm2 == pytest.approx((40 * PERSON / cam.fx) ** 2, rel=0.05)


def test_another_unit_is_the_same():
    assert look((*HEAD, PERSON), unit_um=100)[0].area_mm2 == pytest.approx(
        look((*HEAD, PERSON))[0].area_mm2)


def test_noise_is_no_change_and_a_step_is():
    first = look((*HEAD, PERSON))[0]
    assert look((*HEAD, PERSON + 20))[0].same_as(first)
    assert not look((*HEAD, PERSON + 60))[0].same_as(first)
    assert not look((np.s_[40:80], np.s_[72:112], PERSON))[0].same_as(first)


def test_another_size_or_unit_is_a_change():
    first = look((*HEAD, PERSON))[0]
    assert not look((*HEAD, PERSON), unit_um=100)[0].same_as(first)
