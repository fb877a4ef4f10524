"""Frames of a burst become one."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.capture.burst import fuse
from denseface.capture.errors import FrameError
from denseface.capture.frame import MAX_BURST, DepthMeaning, DepthRounding, RgbdFrame
from tests.unit import frames

H, W = 120, 160
CUT = DepthMeaning(rounding=DepthRounding.CUT)


def burst(depths, meaning=CUT) -> list[RgbdFrame]:
    return [frames.frame(depth.astype(np.uint16), np.full((H, W, 3), 9, np.uint8),
                         depth_meaning=meaning) for depth in depths]


def noisy(seed: int, count: int, noise_mm: float = 1.5) -> tuple[np.ndarray, list[RgbdFrame]]:
    """A slanted plane before a wall, as drivers that cut give it."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:H, :W]
    truth = np.where(u < 120, 700 + 0.3 * u + 0.1 * v, 2500.0)
    return truth, burst([np.floor(truth + noise_mm * rng.standard_normal((H, W)))
                         for _ in range(count)])


def millimetres(frame: RgbdFrame) -> np.ndarray:
    return frame.depth * (frame.depth_meaning.unit_um / 1000) + frame.depth_meaning.offset_mm


@pytest.mark.parametrize("count", [2, 3, 8, 16])
def test_noise_falls_with_the_number_of_frames_and_nothing_is_biased(count):
    truth, shots = noisy(1, count)
    fused = fuse(shots)
    assert fused.origin.fused == count
    assert fused.depth_meaning.rounding is DepthRounding.NONE
    error = (millimetres(fused) - truth)[:, :118]
    assert abs(error.mean()) < 0.05
    assert error.std() < 1.15 * np.sqrt((1.5**2 + 1 / 12) / count)


def test_a_single_frame_stays_as_it_is():
    _, (shot,) = noisy(2, 1)
    assert fuse([shot]) is shot


def test_frames_in_which_somebody_moved_are_left_out_and_it_is_said():
    truth, shots = noisy(3, 4)
    moved = shots[2].depth.copy()
    moved[:, :120] += 8
    fused = fuse([*shots[:2], replace(shots[2], depth=moved), shots[3]])
    assert fused.origin.fused == 3
    assert "1 of the burst's 4 frames" in fused.origin.notes[0]
    assert abs((millimetres(fused) - truth)[:, :118].mean()) < 0.1


def test_where_all_moved_the_first_stands_alone():
    _, shots = noisy(4, 2)
    moved = shots[1].depth.copy()
    moved[:, :120] += 30
    fused = fuse([shots[0], replace(shots[1], depth=moved)])
    assert fused.origin.fused == 1
    assert fused.depth_meaning == CUT
    np.testing.assert_array_equal(fused.depth, shots[0].depth)
    assert fused.origin.notes


def test_what_moves_far_behind_does_not_matter():
    _, shots = noisy(5, 3)
    moved = shots[1].depth.copy()
    moved[:, 125:] -= 500
    assert fuse([shots[0], replace(shots[1], depth=moved), shots[2]]).origin.fused == 3


def test_a_wrong_reading_and_a_hole_do_not_count():
    depth = np.full((3, H, W), 700)
    depth[1, 10, 10] = 900
    depth[0, 20, 20] = 0
    depth[:2, 30, 30] = 0
    fused = millimetres(fuse(burst(depth)))
    assert fused[10, 10] == pytest.approx(700.5, abs=0.06)
    assert fused[20, 20] == pytest.approx(700.5, abs=0.06)
    assert fuse(burst(depth)).depth[30, 30] == 0


@given(far=st.integers(600, 65535))
@settings(max_examples=20, deadline=None)
def test_every_depth_fits_the_unit(far):
    depth = np.full((2, H, W), 700)
    depth[:, :, 100:] = far
    fused = fuse(burst(depth, DepthMeaning()))
    assert millimetres(fused)[0, -1] == pytest.approx(far, abs=fused.depth_meaning.unit_um / 1000)


def test_what_is_no_burst_is_named():
    _, shots = noisy(6, 2)
    with pytest.raises(FrameError, match=f"1 to {MAX_BURST} frames, found 0"):
        fuse([])
    with pytest.raises(FrameError, match="not all of one sensor"):
        fuse([shots[0], replace(shots[1], depth_meaning=DepthMeaning())])
