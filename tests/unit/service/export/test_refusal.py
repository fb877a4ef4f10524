"""The picture of a frame that became no face."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from denseface.recon.face import FaceCandidate
from denseface.service.export import refusal
from denseface.service.export.refusal import draw_refusal
from tests.unit.frames import frame

FLAT = FaceCandidate(box=(40, 30, 60, 60), depth_mm=700.0, width_mm=150.0, verdict="flat")


@pytest.fixture
def wall():
    depth = np.full((120, 160), 700, np.uint16)
    depth[:60] = 0
    return frame(depth, np.full((120, 160, 3), (10, 120, 30), np.uint8))


def drawn(*given):
    return cv2.imdecode(np.frombuffer(draw_refusal(*given), np.uint8), cv2.IMREAD_COLOR)[..., ::-1]


def boxed(picture):
    """Where a box's colour is: x, y, width, height."""
    return cv2.boundingRect((picture == refusal._BOX).all(axis=2).astype(np.uint8))


def test_boxes_are_drawn_where_they_are_with_their_verdict(wall):
    plain, one = (drawn(wall, boxes, "no face") for boxes in ((), (FLAT,)))
    assert boxed(plain) == (0, 0, 0, 0)
    x, y, width, height = boxed(one)
    top = len(one) - 480 - 14
    assert abs(x - (14 + 160)) < 3
    assert abs(y - (top + 120)) < 3
    assert min(width, height) > 235


def test_boxes_of_one_place_and_verdict_are_drawn_once(wall):
    twice = FLAT.model_copy(update={"box": (42, 31, 62, 62)})
    other = FLAT.model_copy(update={"verdict": "no depth", "depth_mm": None, "width_mm": None})
    assert np.array_equal(drawn(wall, (FLAT, twice), "none"), drawn(wall, (FLAT,), "none"))
    assert not np.array_equal(drawn(wall, (FLAT, other), "none"), drawn(wall, (FLAT,), "none"))


def test_depth_is_black_where_nothing_was_measured(wall):
    right = drawn(wall, (), "none")[-494:-14, 2 * 14 + 640:-14]
    assert right[:230].max() == 0
    assert right[250:].max(axis=2).min() > 100


@pytest.mark.parametrize("reason", ["", "x" * 1000, "été ☺\n" * 30])
@pytest.mark.parametrize("box", [(0, 0, 1, 1), (-50, -50, 5000, 5000), (159, 119, 60, 60)])
def test_any_reason_and_any_box_can_be_drawn(wall, reason, box):
    assert drawn(wall, (FLAT.model_copy(update={"box": box}),), reason).shape[1] == 1322


def test_without_colour_the_shaded_depth_is_shown(wall):
    bare = replace(wall, color=None, color_timestamp_us=wall.depth_timestamp_us)
    assert drawn(bare, (FLAT,), "none").std() > 0
