"""Larger pixels of depth: what they hold, and where they look."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.calibration import Calibration
from denseface.capture.frame import DepthMeaning, DepthRounding
from denseface.recon.registration import own_readings, pooled, register
from tests.unit.frames import calibration, camera, frame

COLOR = np.zeros((120, 160, 3), np.uint8)
WHOLE = slice(0, 120), slice(0, 160)


def mean_of_nearest(square, most):
    """What a larger pixel shall hold, counts of the depth; None for no reading."""
    side = len(square)
    read = square[(square > 0) & (square <= most)].astype(float)
    on_it = read[read <= read.min(initial=np.inf) + 8 * (side - 1)]
    return on_it.mean() if len(on_it) >= np.ceil(0.6 * side * side) else None


@pytest.mark.parametrize("side", [2, 3, 4])
@pytest.mark.parametrize("rounding", list(DepthRounding))
def test_a_pixel_is_the_mean_of_its_squares_nearest_surface(side, rounding):
    rng = np.random.default_rng(side)
    depth = rng.choice([0, 700, 704, 712, 1500, 5000], (120, 160),
                       p=[0.1, 0.3, 0.3, 0.1, 0.1, 0.1]).astype(np.uint16)
    given = frame(depth, COLOR, depth_meaning=DepthMeaning(1000, rounding, max_mm=4000))
    coarse, window = pooled(given, WHOLE, side)
    assert coarse.depth.shape == (120 // side, 160 // side)
    assert window == (slice(0, 120 // side), slice(0, 160 // side))
    missing = 0
    for row, column in np.ndindex(coarse.depth.shape):
        expected = mean_of_nearest(
            depth[row * side:(row + 1) * side, column * side:(column + 1) * side], 4000)
        found = int(coarse.depth[row, column]) * coarse.depth_meaning.unit_um / 1000
        if expected is None:
            assert found == 0
            missing += 1
        else:
            assert found == pytest.approx(
                expected + given.depth_meaning.offset_mm,
                abs=coarse.depth_meaning.unit_um / 2000 + 1e-6)
    assert 0 < missing < coarse.depth.size
    assert coarse.depth_meaning.offset_mm == 0


@pytest.mark.parametrize("side", [2, 3])
@pytest.mark.parametrize("distortion", [(0.0,) * 5, (0.02, -0.01, 0.001, -0.001, 0.0)])
def test_points_of_larger_pixels_are_on_the_same_surface(side, distortion):
    """A plane that is tilted stays where it is: its larger pixels look at their squares' middle."""
    known = calibration(depth=camera(distortion=distortion))
    rays = known.depth.rays()
    z = 700 / (1 - 0.3 * rays[..., 0] + 0.2 * rays[..., 1])  # z - 0.3 x + 0.2 y = 700
    meaning = DepthMeaning(50, DepthRounding.NONE)
    given = frame(np.rint(z * 20).astype(np.uint16), COLOR, known, depth_meaning=meaning)
    coarse, window = pooled(given, WHOLE, side)
    points = register(coarse, *window).points.reshape(-1, 3)
    assert len(points) == (120 // side) * (160 // side)
    off = points @ (-0.3, 0.2, 1) - 700
    assert np.abs(off).max() < 0.1
    # And a colour is that of the same place: the fine and the coarse see the plane alike.
    fine = register(given).pixels.reshape(-1, 2)
    seen = register(coarse, *window).pixels.reshape(-1, 2)
    assert np.abs(seen.mean(axis=0) - fine.mean(axis=0)).max() < side / 2


def test_only_the_window_is_made_and_colour_stays():
    depth = np.full((120, 160), 800, np.uint16)
    given = frame(depth, COLOR)
    coarse, window = pooled(given, (slice(31, 62), slice(151, 160)), 2)
    assert window == (slice(15, 31), slice(75, 80))
    assert (coarse.depth[window] == 800 * 1000 // coarse.depth_meaning.unit_um).all()
    assert np.count_nonzero(coarse.depth) == 16 * 5
    assert coarse.color is given.color
    assert coarse.origin is given.origin


def test_a_frame_in_colours_pixels_keeps_its_axes():
    both = Calibration(depth=camera(), color=camera(f=140))
    given = replace(frame(np.full((120, 160), 800, np.uint16), COLOR, both), registered=True)
    coarse, window = pooled(given, WHOLE, 2)
    assert coarse.depth_camera.fx == 70
    found = register(coarse, *window)
    # The middle of a square is between the pixels that were.
    np.testing.assert_allclose(found.pixels[10, 20], (40.5, 20.5), atol=1e-3)


def test_what_does_not_fit_into_the_finer_unit_is_no_reading():
    depth = np.full((120, 160), 800, np.uint16)
    depth[:, 80:] = 20_000
    coarse, _ = pooled(frame(depth, COLOR), WHOLE, 2)
    assert (coarse.depth[:, :40] > 0).all()
    assert not coarse.depth[:, 40:].any()


@pytest.mark.parametrize("side", [2, 3])
def test_own_readings_are_those_that_were_averaged(side):
    rng = np.random.default_rng(side)
    depth = rng.choice([0, 700, 703, 1500], (120, 160), p=[0.1, 0.5, 0.3, 0.1]).astype(np.uint16)
    given = frame(depth, COLOR)
    coarse, _ = pooled(given, WHOLE, side)
    pixels = np.argwhere(coarse.depth > 0)[7::5].astype(np.int32)
    z = (coarse.depth[tuple(pixels.T)] / 4).astype(np.float32)
    points, own = own_readings(given, pixels, z, side)
    np.testing.assert_array_equal(points[:, 2], depth[tuple(own.T)])
    of_square = {}
    for place, reading in zip((own // side).tolist(), points[:, 2].tolist(), strict=True):
        of_square.setdefault(tuple(place), []).append(reading)
    assert set(of_square) == set(map(tuple, pixels.tolist()))
    for (row, column), mean in zip(pixels.tolist(), z.tolist(), strict=True):
        assert np.mean(of_square[row, column]) == pytest.approx(mean, abs=0.13)
