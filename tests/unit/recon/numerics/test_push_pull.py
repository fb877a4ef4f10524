"""Colours are their neighbours' mean."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.recon.numerics.push_pull import interpolate_colors

LEFT, RIGHT = (210, 150, 120), (40, 70, 200)


def two_tones(every: int, shape: tuple[int, int] = (60, 80)) -> tuple[np.ndarray, np.ndarray]:
    """Colours on every so many pixels, another one on each side of the middle."""
    coordinates = np.stack(np.mgrid[:shape[0]:every, :shape[1]:every], axis=-1).reshape(-1, 2)
    left = coordinates[:, 1] < shape[1] / 2
    return np.where(left[:, None], LEFT, RIGHT).astype(np.uint8), coordinates


@pytest.mark.parametrize("every", [1, 3, 4])
def test_each_side_keeps_its_colour(every):
    colors, coordinates = two_tones(every)
    image = interpolate_colors(colors, coordinates, np.ones((60, 80), bool), 0.5 * every, every)
    away = 2 * every + 1
    assert (image[:, :40 - away] == LEFT).all()
    assert (image[:, 40 + away:] == RIGHT).all()
    # Between them, in order, and nothing that is neither.
    across = image.astype(int)
    assert (np.diff(across[..., 0], axis=1) <= 0).all()
    assert (np.diff(across[..., 2], axis=1) >= 0).all()


def test_a_hole_takes_the_colours_around_it():
    colors, coordinates = two_tones(3)
    hole = np.hypot(coordinates[:, 0] - 30, coordinates[:, 1] - 40) < 20
    image = interpolate_colors(colors[~hole], coordinates[~hole], np.ones((60, 80), bool), 1.5, 3)
    assert np.abs(image[30, 24].astype(int) - LEFT).max() < 10
    assert np.abs(image[30, 56].astype(int) - RIGHT).max() < 10
    middle = image[30, 39].astype(int)
    assert ((middle >= np.minimum(LEFT, RIGHT)) & (middle <= np.maximum(LEFT, RIGHT))).all()


def test_one_colour_reaches_everywhere():
    image = interpolate_colors(np.array([LEFT], np.uint8), np.array([[0, 0]]),
                              np.ones((50, 300), bool), 1, 3)
    assert (image == LEFT).all()


def test_what_is_not_wanted_stays_black():
    wanted = np.zeros((60, 80), bool)
    wanted[20:30, 10:50] = True
    image = interpolate_colors(*two_tones(2), wanted, 1, 2)
    assert not image[~wanted].any()
    assert image[wanted].any(axis=1).all()
    assert image.dtype == np.uint8


@settings(deadline=None, max_examples=30)
@given(seed=st.integers(0, 999), count=st.integers(1, 200), low=st.integers(0, 200),
       span=st.integers(0, 55), radius=st.floats(0.5, 4))
def test_a_mean_is_within_what_it_is_of(seed, count, low, span, radius):
    rng = np.random.default_rng(seed)
    colors = rng.integers(low, low + span + 1, (count, 3)).astype(np.uint8)
    coordinates = np.column_stack([rng.integers(0, 30, count), rng.integers(0, 40, count)])
    image = interpolate_colors(colors, coordinates, np.ones((30, 40), bool), radius, 2 * radius)
    assert (image >= colors.min(axis=0)).all()
    assert (image <= colors.max(axis=0)).all()


def test_nothing_to_average_is_named():
    with pytest.raises(ValueError, match="colors must not be empty"):
        interpolate_colors(np.zeros((0, 3), np.uint8), np.zeros((0, 2), int),
                          np.ones((4, 4), bool), 1, 1)
