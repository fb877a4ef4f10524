"""Landmarks of a surface that is drawn, not measured."""

import numpy as np
import pytest

from denseface.recon.measurement._face_map import STEP_MM, FaceMap
from denseface.recon.measurement._landmarks import find_landmarks

PROFILE = np.array([(-120, 22), (-38, 20), (0, 0), (12, 16), (22, 13), (35, 20), (60, 16),
                    (68, 17), (84, 40), (90, 70)], float)
"""y and z, mm, of forehead, sellion, tip, subnasale, lip, mouth and chin."""
GROOVE_MM, HALF_MM = 19.0, 66.0


def drawn(until_mm=120.0, *, one_side=False) -> FaceMap:
    """A profile, a nose with grooves, and cheeks that fall off to the sides."""
    at = STEP_MM * np.arange(-120, 121.0)
    z = np.interp(at, *PROFILE.T)
    x = np.abs(at)
    # Sides reach 50 mm behind the sellion at HALF_MM.
    cheek = 20 + 50 * (x / HALF_MM) ** 4
    height = np.minimum(np.maximum(z[:, None], cheek), 150.0)
    nose = (at > -38) & (at < 16)
    height[nose] = np.where(x < GROOVE_MM, z[nose, None] + (24 - z[nose, None]) * x / GROOVE_MM,
                            24 - 0.35 * (x - GROOVE_MM) + (x > 40) * cheek)
    height[at > until_mm] = np.nan
    height[:, np.abs(at) > 95] = np.nan
    if one_side:
        height[:, at > 40] = np.nan
    return FaceMap(height.astype(np.float32), np.full(height.shape, 0.5, np.float32), at)


def test_the_ends_are_where_they_were_drawn():
    marks = find_landmarks(drawn())
    assert marks.sellion == pytest.approx((-38, 20), abs=2.0)
    assert marks.subnasale == pytest.approx((12, 15), abs=2.0)
    assert marks.gnathion == pytest.approx((68, 18), abs=3.0)
    assert marks.grooves == pytest.approx(2 * GROOVE_MM, abs=2.0)


def test_a_side_that_does_not_show_is_taken_to_be_as_the_other():
    both, one = find_landmarks(drawn()), find_landmarks(drawn(one_side=True))
    assert one.face_width == pytest.approx(both.face_width, abs=0.1)


def test_a_chin_that_does_not_show_is_not_guessed():
    marks = find_landmarks(drawn(until_mm=60.0))
    assert marks.gnathion is None
    assert marks.subnasale == pytest.approx((12, 15), abs=2.0)


def test_without_forehead_or_lips_there_are_none():
    assert find_landmarks(drawn(until_mm=20.0)) is None
    assert find_landmarks(drawn(until_mm=-121.0)) is None
