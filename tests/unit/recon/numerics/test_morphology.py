import cv2
import numpy as np
import pytest

from denseface.recon.numerics.morphology import disc, enclosed_parts, opened


@pytest.mark.parametrize("radius", [4.5, 12.5])
def test_opening_by_distances_is_nearly_morphologys(radius):
    rng = np.random.default_rng(3)
    area = (cv2.GaussianBlur(rng.normal(size=(160, 200)), (0, 0), 7) > 0).astype(np.uint8)
    expected = cv2.morphologyEx(area, cv2.MORPH_OPEN, disc(radius))
    found = opened(area, radius)
    assert 0.1 < expected.mean() < area.mean() - 0.005
    assert ((found > 0) <= (area > 0)).all()
    assert (found != expected).mean() < 0.02


def test_nothing_is_left_of_what_is_too_narrow():
    area = np.zeros((40, 40), np.uint8)
    area[10:17] = 1
    assert not opened(area, 5).any()
    assert (opened(area, 2) == area).all()


def test_parts_that_reach_the_border_are_not_enclosed():
    mask = np.zeros((9, 12), bool)
    mask[0:3, 0:3] = mask[3, 3] = True  # joined at a corner to what reaches the border
    mask[5:7, 2:5] = mask[7, 5] = True
    mask[3, 9] = True
    labels, parts = enclosed_parts(mask)
    assert sorted(parts[:, 1:].tolist()) == [[2, 5, 4, 3], [9, 3, 1, 1]]
    expected = mask.copy()
    expected[:4, :4] = False
    assert ((labels > 0) == expected).all()
    for label, *_ in parts:
        assert (labels == label).sum() in (1, 7)
    assert not len(enclosed_parts(np.ones((3, 4), bool))[1])
