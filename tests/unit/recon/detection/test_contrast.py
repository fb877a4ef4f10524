"""Contrast is equalised by samples of what is wanted, in a part of an image alone."""

import numpy as np
import pytest

from denseface.recon.detection._contrast import equalize_contrast, lift_shadows

ROI = (60, 40, 200, 180)
IN_ROI = np.s_[40:220, 60:260]
INSIDE = np.s_[90:170, 110:210]
NOTHING = np.empty(0, np.uint8)


@pytest.fixture
def dark_before_bright():
    """Dark shades with a texture of 12 levels, a bright wall around them."""
    image = np.full((240, 320), 230, np.uint8)
    image[INSIDE] = np.random.default_rng(0).integers(20, 32, image[INSIDE].shape)
    return image


def test_what_is_wanted_gets_the_whole_range_whatever_is_behind(dark_before_bright):
    wanted = dark_before_bright[INSIDE].ravel()
    before = np.ptp(dark_before_bright[INSIDE])
    after = np.percentile(equalize_contrast(dark_before_bright, ROI, wanted)[INSIDE], (10, 90))
    assert before < 12
    assert np.diff(after) > 120


def test_by_all_of_the_part_the_wall_counts(dark_before_bright):
    by_all = np.percentile(equalize_contrast(dark_before_bright, ROI, NOTHING)[INSIDE], (10, 90))
    wanted = dark_before_bright[INSIDE].ravel()
    by_wanted = np.percentile(equalize_contrast(dark_before_bright, ROI, wanted)[INSIDE], (10, 90))
    assert np.diff(by_all) < 0.5 * np.diff(by_wanted)


def test_the_rest_of_the_image_stays_and_the_image_itself(dark_before_bright):
    kept = dark_before_bright.copy()
    after = equalize_contrast(dark_before_bright, ROI, NOTHING)
    np.testing.assert_array_equal(dark_before_bright, kept)
    after[IN_ROI] = kept[IN_ROI]
    np.testing.assert_array_equal(after, kept)


@pytest.mark.parametrize("shade", [0, 128, 255])
def test_one_shade_is_spread_to_no_noise(shade):
    image = np.full((240, 320), shade, np.uint8)
    assert np.ptp(equalize_contrast(image, ROI, image[IN_ROI].ravel())) <= 255
    assert np.ptp(equalize_contrast(image, ROI, image[IN_ROI].ravel())[IN_ROI]) == 0


def test_a_part_smaller_than_a_tile_is_equalized(dark_before_bright):
    after = equalize_contrast(dark_before_bright, (100, 80, 30, 25), NOTHING)
    assert after.shape == dark_before_bright.shape


def test_shadows_are_lifted_by_the_square_root():
    levels = np.array([[0, 1, 16, 64, 255]], np.uint8)
    np.testing.assert_array_equal(lift_shadows(levels), [[0, 16, 64, 128, 255]])
