"""The sensor's levels of depth."""

import cv2
import numpy as np
import pytest

from tests.simulator import Scene, shared_folder, simulate
from tests.simulator.shift import depth_levels, depth_to_shift, quantize, shift_to_depth


def test_shift_and_depth_are_inverse():
    shift = np.arange(1.0, 1080.0, 0.25)
    np.testing.assert_allclose(depth_to_shift(shift_to_depth(shift)), shift, atol=1e-8)


@pytest.mark.parametrize(("depth", "step"), [(600, 1.0), (800, 1.9), (1000, 2.9), (2000, 11.6)])
def test_steps_grow_with_the_square_of_the_distance(depth, step):
    shift = np.rint(depth_to_shift(np.array(float(depth))))
    assert shift_to_depth(shift + 0.5) - shift_to_depth(shift - 0.5) == pytest.approx(
        step, abs=0.15)


def test_nothing_out_of_range_gets_a_depth():
    assert not quantize(np.array([np.nan, -np.inf, np.inf, -5.0, 0.0, 2047.0, 1e9])).any()


def test_every_simulated_depth_is_a_level():
    depth = simulate(Scene())[0].frame.depth
    found = np.unique(depth[depth > 0])
    assert len(found) > 100
    assert np.isin(found, depth_levels()).all()


def test_every_depth_of_a_real_kinect_is_a_level():
    shared = shared_folder()
    if shared is None:
        pytest.skip("no folder `shared` beside the project: the real recording is not at hand")
    picture = shared / "recordings" / "kinect_v1_person_profile_depth_mm.png"
    real = cv2.imread(str(picture), cv2.IMREAD_UNCHANGED)
    assert np.isin(np.unique(real[real > 0]), depth_levels()).all()
