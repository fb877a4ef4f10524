from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.rotation import rotate_frame
from denseface.recon import CoarseDepthError, NoFaceError, reconstruct
from denseface.recon.judgement import check_face, check_steps
from tests.simulator import Person, Scene, simulate

PIXEL_MM2 = 1 / 575.8**2
"""What a Kinect's pixel covers at 1 mm."""


@pytest.fixture(scope="module")
def frame():
    return simulate(Scene((Person("procedural", 700),), decor=3), seed=12)[0].frame


def in_steps(frame, step):
    return replace(frame, depth=(np.rint(frame.depth / step) * step).astype(np.uint16))


def dome(width=130.0, height=190.0, relief=45.0, z=700.0):
    """A face's size and depth, in the pixels of a Kinect."""
    step = z / 575.8
    x, y = np.meshgrid(np.arange(-width / 2, width / 2, step), np.arange(-height / 2, height / 2,
                                                                       step))
    inside = (2 * x / width) ** 2 + (2 * y / height) ** 2 <= 1
    depth = z + relief * ((2 * x / width) ** 2 + (2 * y / height) ** 2)
    return np.stack([x, y, depth], axis=-1)[inside].astype(np.float32)


@pytest.mark.parametrize("size", [{}, {"width": 85.0, "height": 120.0, "relief": 25.0},
                                  {"width": 190.0, "height": 260.0}, {"z": 1800.0}])
def test_what_has_a_faces_size_passes(size):
    check_face(dome(**size), PIXEL_MM2, (1, 2, 3, 4))


@pytest.mark.parametrize("size", [
    {"relief": 2.0}, {"width": 30.0}, {"height": 40.0}, {"width": 400.0}, {"height": 500.0}])
def test_what_has_not_is_none(size):
    with pytest.raises(NoFaceError, match=r"what the box at \(1, 2, 3, 4\) shows is \d+ x \d+ mm"):
        check_face(dome(**size), PIXEL_MM2, (1, 2, 3, 4))


def test_few_readings_over_a_face_are_none():
    with pytest.raises(NoFaceError, match="measured on 2 cm2"):
        check_face(dome()[::100], PIXEL_MM2, (1, 2, 3, 4))


@pytest.mark.parametrize(("z", "step", "said"), [
    (700, 1, False), (700, 3, False), (700, 5, True), (1000, 5, False), (1000, 8, True),
    (1800, 11, False)])
def test_steps_are_judged_by_the_sensors_own(z, step, said):
    depth = np.rint(dome(z=z)[:, 2] / step) * step
    assert bool(check_steps(depth, float(z))) == said


def test_too_little_shows_no_steps():
    assert check_steps(np.full(1000, 700, np.float32), 700.0) == ""
    assert check_steps(np.arange(600, 800, 20, dtype=np.float32), 700.0) == ""


@pytest.mark.parametrize("step", [10, 20, 40])
def test_coarse_depth_is_named(frame, step):
    with pytest.raises(CoarseDepthError, match=f"steps of {step} mm"):
        reconstruct(in_steps(frame, step))


def test_rather_coarse_depth_is_said_and_sigma_knows_it(frame):
    fine, coarse = reconstruct(frame), reconstruct(in_steps(frame, 5))
    assert fine.report.warnings == ()
    (warning,) = coarse.report.warnings
    assert "steps of 5 mm at 7" in warning
    assert np.median(coarse.dense.sigma) > 1.2 * np.median(fine.dense.sigma)


@pytest.mark.parametrize("degrees", [90, 180, 270])
def test_a_sensor_on_its_side_is_turned_or_said_to_be(frame, degrees):
    lying = rotate_frame(frame, 360 - degrees)
    with pytest.raises(NoFaceError, match=rf"turned by {degrees} degrees \(--rotate {degrees}\)"):
        reconstruct(lying)
    upright = reconstruct(rotate_frame(lying, degrees))
    assert np.array_equal(upright.dense.points, reconstruct(frame).dense.points)
