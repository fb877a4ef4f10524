"""Shading tells shape that a surface lacks, and little where skin merely has another colour."""

import numpy as np
import pytest

from denseface.recon.detail._shading import shading_detail, shape_from_shading
from denseface.recon.noise import least_risk
from tests.unit.recon.shapes import NOISE

STEP = 1.2
XS = np.arange(-50, 50, STEP)
X, Y = np.meshgrid(XS, XS)
EVERYWHERE = np.ones(X.shape, np.float32)
LIGHTS = [(0.25, -0.45, -1.0), (1.0, -0.2, -0.6), (0.0, -1.0, -0.6), (0.0, 0.0, -1.0)]
BUMP = np.hypot(X - 12, Y + 8) < 9


def slopes(heights):
    down, across = np.gradient(heights, STEP)
    return across.astype(np.float32), down.astype(np.float32)


def lit(heights, toward, ambient=0.35):
    """Linear brightness of even skin in one lamp's light."""
    across, down = slopes(heights)
    normals = np.stack([across, down, -np.ones_like(across)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    toward = np.array(toward) / np.linalg.norm(toward)
    return (ambient + 0.75 * np.maximum(normals @ toward, 0)).astype(np.float32)


PLAN = least_risk(NOISE, 1.2, 1.0)._replace(error_mm=0.5, radius_mm=3.0)
BALL = (700 - np.sqrt(90.0**2 - X**2 - Y**2)).astype(np.float64)
WITH_BUMP = BALL - 0.8 * np.exp(-((X - 12) ** 2 + (Y + 8) ** 2) / (2 * 3.5**2))


def found(brightness, weight=EVERYWHERE):
    """What is added to the ball without the bump."""
    return shape_from_shading(np.asarray(brightness, np.float32), weight, slopes(BALL), STEP,
                              1.2 * PLAN.error_mm, PLAN.radius_mm)


def rms(values):
    return float(np.sqrt((values**2).mean()))


@pytest.mark.parametrize(("toward", "left"),
                         list(zip(LIGHTS, (0.88, 0.65, 0.62, 0.97), strict=True)))
def test_a_bump_that_depth_missed_comes_back_in_part(toward, left):
    """The more, the more the lamp is aside."""
    added = found(lit(WITH_BUMP, toward))
    assert rms((BALL + added - WITH_BUMP)[BUMP]) < left * rms((BALL - WITH_BUMP)[BUMP])


@pytest.mark.parametrize("toward", [LIGHTS[0], LIGHTS[3]])
def test_nothing_is_added_where_the_shading_is_that_of_the_surface(toward):
    assert np.abs(found(lit(BALL, toward))[3:-3, 3:-3]).max() < 0.06


@pytest.mark.parametrize("toward", LIGHTS[1:3])
def test_where_a_lamp_s_light_ends_little_is_added(toward):
    """Nine harmonics do not have the kink there."""
    added = found(lit(BALL, toward))
    assert np.abs(added).max() < 1
    assert rms(added) < 0.25


def test_an_even_image_says_nothing():
    np.testing.assert_allclose(found(0.4 * EVERYWHERE), 0, atol=0.01)


@pytest.mark.parametrize("darker", [0.85, 0.5, 0.2])
def test_a_mark_on_the_skin_makes_little_shape(darker):
    mark = np.where(np.hypot(X - 10, Y) < 8, darker, 1.0)
    added = found(lit(BALL, LIGHTS[0]) * mark)
    assert np.abs(added).max() < 0.7
    assert rms(added[np.hypot(X - 10, Y) < 14]) < 0.3


def test_a_shadows_edge_makes_little_shape():
    added = found(lit(BALL, LIGHTS[0]) * np.where(X + 0.5 * Y > 5, 0.5, 1.0))
    assert np.abs(added).max() < 1.1
    assert rms(added) < 0.35


def test_how_bright_the_image_is_does_not_matter():
    brightness = lit(WITH_BUMP, LIGHTS[1])
    np.testing.assert_allclose(found(0.2 * brightness), found(brightness), atol=1e-3)


def test_noise_of_the_image_makes_little_shape():
    rng = np.random.default_rng(5)
    noisy = lit(BALL, LIGHTS[0]) * (1 + 0.04 * rng.standard_normal(X.shape))
    assert rms(found(noisy)) < 0.05


def test_light_itself_is_found_in_each_frame():
    """With the lamp on the other side the same bump comes back, not its opposite."""
    for side in (-1, 1):
        added = found(lit(WITH_BUMP, (0.6 * side, -0.2, -1)))
        assert np.vdot(added[BUMP], (WITH_BUMP - BALL)[BUMP]) > 0


def test_what_does_not_count_does_not_matter():
    brightness = lit(WITH_BUMP, LIGHTS[0])
    weight = np.where(np.hypot(X + 20, Y - 5) < 8, 0, 1).astype(np.float32)
    spoilt = np.where(weight > 0, brightness, 7.0)
    np.testing.assert_array_equal(found(spoilt, weight), found(brightness, weight))


@pytest.mark.parametrize("weight", [0 * EVERYWHERE, np.where(np.hypot(X, Y) < 3, EVERYWHERE, 0)])
def test_too_little_to_find_the_light_adds_nothing(weight):
    assert not found(lit(WITH_BUMP, LIGHTS[0]), weight.astype(np.float32)).any()


def test_a_black_image_adds_nothing():
    assert not found(0 * EVERYWHERE).any()


def image_of(brightness, seen=None, spoilt=None):
    """Something that looks colours up in an image of grey skin, sRGB."""
    values = np.clip(255 * (0.8 * brightness) ** (1 / 2.2), 0, 255).astype(np.uint8)
    if spoilt is not None:
        values[spoilt] = 255
    seen = np.ones(X.shape, np.bool_) if seen is None else seen

    def sampler(points):
        columns, rows = (np.rint((points[:, axis] - XS[0]) / STEP).astype(int) for axis in (0, 1))
        colors = np.repeat(values[rows, columns][:, None], 3, axis=1)
        colors[~seen[rows, columns]] = 0
        return colors, seen[rows, columns]

    return sampler


def test_a_colour_image_tells_as_much_as_its_brightness():
    brightness = lit(WITH_BUMP, LIGHTS[0])
    added = shading_detail(BALL.astype(np.float32), EVERYWHERE, slopes(BALL), (XS, XS),
                           image_of(brightness), PLAN)
    np.testing.assert_allclose(added, found(brightness), atol=0.05)


@pytest.mark.parametrize("how", ["seen", "spoilt"])
def test_what_is_hidden_or_saturated_does_not_count(how):
    brightness = lit(WITH_BUMP, LIGHTS[0])
    place = np.hypot(X + 20, Y - 5) < 8
    sampler = (image_of(brightness, seen=~place) if how == "seen"
               else image_of(brightness, spoilt=place))
    added, other = (shading_detail(BALL.astype(np.float32), weight, slopes(BALL), (XS, XS), image,
                                   PLAN)
                    for weight, image in ((EVERYWHERE, sampler),
                                          ((EVERYWHERE * ~place), image_of(brightness))))
    np.testing.assert_array_equal(added, other)


def test_a_face_that_is_nowhere_adds_nothing():
    added = shading_detail(BALL.astype(np.float32), 0 * EVERYWHERE, slopes(BALL), (XS, XS),
                           image_of(EVERYWHERE), PLAN)
    assert not added.any()
