"""One right frame, and what is wrong with it when it is."""

from dataclasses import replace

import numpy as np
import pytest

from denseface.capture.agreement import Verdict, measure_agreement
from denseface.capture.calibration import Calibration
from denseface.capture.frame import DepthMeaning
from tests.faults import FAULTS, registered_depth
from tests.unit.capture.agreement.boards import CALIBRATION, boards_frame

RIGHT = boards_frame()


def test_a_right_frame_agrees_and_is_left_alone():
    found = measure_agreement(RIGHT)
    assert (found.verdict, found.note, found.offset_px) == (Verdict.AGREES, "", (0, 0))
    assert found.correction.apply(RIGHT) is RIGHT
    assert measure_agreement(registered_depth(RIGHT)).verdict is Verdict.AGREES


@pytest.mark.parametrize("fault", FAULTS)
def test_each_fault_is_put_right_or_said(fault):
    wrong = FAULTS[fault](RIGHT)
    found = measure_agreement(wrong)
    assert found.verdict is Verdict.CORRECTED, (found.note, found.scores)
    assert found.note.endswith(": corrected")
    right = found.correction.apply(wrong)
    assert measure_agreement(right).verdict is Verdict.AGREES
    assert right.registered == (fault == "registered, not said")
    assert right.depth_to_color.translation_mm == pytest.approx(
        (0, 0, 0) if right.registered else (-23, 0, 0))
    if not right.registered:
        assert np.array_equal(right.depth, RIGHT.depth)
        assert np.array_equal(right.color, RIGHT.color)


@pytest.mark.parametrize("moved_mm", [-60, -25, 25, 60])
def test_who_moves_between_depth_and_colour_is_seen_to(moved_mm):
    found = measure_agreement(boards_frame(moved_mm))
    assert found.verdict is Verdict.DOUBTFUL
    across, down = found.offset_px
    assert across == pytest.approx(525 * moved_mm / 800, abs=3)
    assert abs(down) <= 4
    assert f"{across}, {down} pixels" in found.note
    assert found.lasting_note == ""


def test_another_scene_is_refused():
    boards = ((-300, -100, 60, 300, 900, 220), (-400, -250, -330, 250, 1200, 20),
              (120, -260, 400, -60, 1100, 170), (200, 60, 260, 330, 1000, 40))
    found = measure_agreement(replace(RIGHT, color=boards_frame(boards=boards, seed=1).color))
    assert found.verdict is Verdict.REFUSED, found.scores
    assert "do not belong together" in found.note


@pytest.mark.parametrize("blank", [
    lambda frame: replace(frame, color=None),
    lambda frame: replace(frame, color=np.full_like(frame.color, 90)),
    lambda frame: replace(frame, color=np.random.default_rng(2).integers(
        0, 8, frame.color.shape, np.uint8)),
    lambda frame: replace(frame, depth=np.zeros_like(frame.depth)),
    lambda frame: replace(frame, depth=np.full_like(frame.depth, 1500)),
    lambda frame: replace(boards_frame(boards=()), origin=frame.origin),
], ids=["no colour", "grey", "dark", "no depth", "wall", "one wall"])
def test_of_what_shows_nothing_nothing_is_said(blank):
    found = measure_agreement(blank(RIGHT))
    assert (found.verdict, found.note) == (Verdict.UNKNOWN, "")


def test_specks_of_noise_are_no_outlines():
    rng = np.random.default_rng(3)
    specks = rng.random(RIGHT.depth.shape) < 0.08
    depth = np.where(specks, rng.integers(300, 4000, specks.shape), RIGHT.depth).astype(np.uint16)
    assert measure_agreement(replace(RIGHT, depth=depth)).verdict is Verdict.AGREES


def test_other_units_and_sizes():
    tenths = replace(RIGHT, depth=10 * RIGHT.depth, depth_meaning=DepthMeaning(unit_um=100))
    assert measure_agreement(tenths).verdict is Verdict.AGREES
    large = replace(
        RIGHT, color=np.ascontiguousarray(RIGHT.color.repeat(2, axis=0).repeat(2, axis=1)),
        calibration=Calibration(depth=CALIBRATION.depth, color=CALIBRATION.color.scaled(2),
                                depth_to_color=CALIBRATION.depth_to_color))
    assert measure_agreement(large).verdict is Verdict.AGREES
    wrong = FAULTS["pose inverted"](large)
    assert measure_agreement(wrong).correction.pose is not None
    half = replace(
        RIGHT, depth=np.ascontiguousarray(RIGHT.depth[::2, ::2]),
        calibration=Calibration(
            depth=CALIBRATION.depth.scaled(0.5).model_copy(update={"cx": 159.75, "cy": 119.75}),
            color=CALIBRATION.color, depth_to_color=CALIBRATION.depth_to_color))
    assert measure_agreement(half).verdict is Verdict.AGREES


def test_a_tiny_image_says_nothing():
    camera = CALIBRATION.depth.model_copy(update={"width": 4, "height": 3, "cx": 1.5, "cy": 1.0})
    frame = replace(RIGHT, depth=np.full((3, 4), 900, np.uint16),
                    color=np.zeros((3, 4, 3), np.uint8),
                    calibration=Calibration(depth=camera, color=camera))
    assert measure_agreement(frame).verdict is Verdict.UNKNOWN
