"""Along the outline: the face's own colour, never that of what is behind."""

import cv2
import numpy as np
import pytest

from denseface.recon.segmentation._edge_colors import seed_colors
from tests.unit.recon.shapes import NEAR, ellipsoid, registration

HEAD = ellipsoid()
ON_HEAD = np.isfinite(HEAD)
SKIN, WALL, HAIR, RED = (200, 150, 120), (30, 220, 40), (50, 40, 30), (230, 100, 120)
ROWS = np.arange(len(HEAD))[:, None]
HAIRY = ON_HEAD & (np.flatnonzero(ON_HEAD.any(axis=1))[0] + 12 > ROWS)


def painted(*, hair: bool, blur: int = 5, missed: int = 0) -> np.ndarray:
    """A head before a wall, (H, W, 3) uint8; where the wall is `missed` pixels over its edge."""
    color = np.empty((*HEAD.shape, 3), np.uint8)
    color[:] = WALL
    color[ON_HEAD] = SKIN
    if hair:
        color[HAIRY] = HAIR
    if missed:
        inner = cv2.erode(ON_HEAD.astype(np.uint8), np.ones((2 * missed + 1,) * 2, np.uint8))
        color[inner == 0] = WALL
    return np.asarray(cv2.GaussianBlur(color, (blur, blur), 0), np.uint8)


def found(color: np.ndarray, wall_mm: float = NEAR + 500) -> np.ndarray:
    colors = np.zeros((*HEAD.shape, 3), np.uint8)
    tied = registration(np.minimum(HEAD, wall_mm), color)
    colors[ON_HEAD] = seed_colors(tied, ON_HEAD, ON_HEAD.astype(np.uint8))
    return colors


@pytest.mark.parametrize("wall_mm", [NEAR + 500, np.inf])
def test_no_wall_is_on_the_outline_measured_or_not(wall_mm):
    color = painted(hair=False)
    assert np.abs(color[ON_HEAD].astype(int) - SKIN).max() > 50
    assert np.abs(found(color, wall_mm)[ON_HEAD].astype(int) - SKIN).max() <= 2


def test_a_pixel_that_shows_nothing_but_the_wall_takes_its_neighbours_colour():
    color = painted(hair=False, blur=1, missed=2)
    assert (color[ON_HEAD] == WALL).all(axis=1).sum() > 100
    assert np.abs(found(color)[ON_HEAD].astype(int) - SKIN).max() <= 2


def test_another_wall_that_was_not_measured_leaves_nothing_either():
    """As in the projector's shadow: all that is known behind is green, and what shows is not."""
    color = painted(hair=False, blur=1)
    left = np.arange(HEAD.shape[1]) < HEAD.shape[1] // 2
    color[(color == WALL).all(axis=2) & left] = (225, 30, 200)
    color = cv2.GaussianBlur(color, (5, 5), 0)
    shadow = np.isfinite(HEAD[100]).argmax()  # the column of the leftmost of the head
    depth = np.where(np.arange(HEAD.shape[1]) < HEAD.shape[1] // 2, np.inf, NEAR + 500.0)
    tied = registration(np.minimum(HEAD, depth), np.asarray(color, np.uint8))
    colors = np.zeros((*HEAD.shape, 3), np.uint8)
    colors[ON_HEAD] = seed_colors(tied, ON_HEAD, ON_HEAD.astype(np.uint8))
    beside = ON_HEAD & (np.arange(HEAD.shape[1]) < shadow + 12)
    assert beside.sum() > 100
    assert np.abs(color[beside].astype(int) - SKIN).max() > 50
    assert np.abs(colors[beside].astype(int) - SKIN).max() <= 6


def test_hair_along_the_outline_keeps_its_colour():
    colors = found(painted(hair=True))
    edge = ON_HEAD & ~cv2.erode(ON_HEAD.astype(np.uint8), np.ones((5, 5), np.uint8)).astype(bool)
    top = edge & (HAIRY & (np.flatnonzero(HAIRY.any(axis=1))[-1] - 3 > ROWS))
    assert top.sum() > 30
    off = np.abs(colors[top].astype(int) - HAIR)
    assert off.max() < 50  # beside the skin
    assert off.mean() < 3


def test_another_colour_at_the_edge_is_kept_where_the_wall_is_known():
    """A red edge, as of an ear: no mixture of skin with a green wall."""
    color = painted(hair=False, blur=1)
    inner = cv2.erode(ON_HEAD.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    color[ON_HEAD & ~inner] = RED
    assert (found(color)[ON_HEAD & ~inner] == RED).mean() > 0.9
    # With nothing measured behind, nobody can say.
    assert np.abs(found(color, np.inf)[ON_HEAD & ~inner].astype(int) - SKIN).max() <= 2


def test_a_face_too_thin_for_an_inside_keeps_what_is_seen():
    line = np.zeros(HEAD.shape, bool)
    line[100, 150:170] = True
    tied = registration(np.where(line, NEAR, np.inf), painted(hair=False))
    colors = seed_colors(tied, line, line.astype(np.uint8))
    np.testing.assert_array_equal(colors, tied.colors[line])
