"""What a source's frames go through, with what is measured given."""

import numpy as np
import pytest

from denseface.capture import preparation
from denseface.capture.agreement import Agreement, Verdict, measure_agreement
from denseface.capture.errors import MismatchedFrameError
from denseface.capture.preparation import FramePreparation
from tests.faults import FAULTS
from tests.unit import frames
from tests.unit.capture.agreement.boards import boards_frame

DEPTH = np.arange(120 * 160, dtype=np.uint16).reshape(120, 160)
FRAME = frames.frame(DEPTH, np.zeros((120, 160, 3), np.uint8))
AGREES, UNKNOWN = Agreement(Verdict.AGREES), Agreement(Verdict.UNKNOWN)
REFUSED = Agreement(Verdict.REFUSED, note="nothing fits")
MOVED = Agreement(Verdict.DOUBTFUL, note="moved", offset_px=(12, 0))
UNSURE = Agreement(Verdict.DOUBTFUL, note="this or that")


@pytest.fixture
def corrected():
    found = measure_agreement(FAULTS["depth mirrored"](boards_frame()))
    assert found.correction.turn_depth
    return found


class Measured:
    """Gives verdicts in their order; the last one for ever."""

    def __init__(self, monkeypatch, *verdicts):
        self.left = list(verdicts)
        self.count = 0
        self.now = 0.0
        monkeypatch.setattr(preparation, "measure_agreement", self)

    def __call__(self, frame):
        assert frame is FRAME
        self.count += 1
        return self.left.pop(0) if len(self.left) > 1 else self.left[0]

    def clock(self):
        return self.now


def notes(prepared, number=1):
    return [prepared.of(FRAME).origin.notes for _ in range(number)]


def test_what_agrees_is_given_as_it_is_and_measured_once_a_minute(monkeypatch):
    measured = Measured(monkeypatch, AGREES)
    prepared = FramePreparation(clock=measured.clock)
    assert all(prepared.of(FRAME) is FRAME for _ in range(10))
    assert measured.count == 1
    measured.now = 60.5
    prepared.of(FRAME)
    prepared.of(FRAME)
    assert measured.count == 2
    prepared.look_closely()
    prepared.of(FRAME)
    assert measured.count == 3


def test_a_correction_is_applied_to_all_that_follow(monkeypatch, corrected):
    measured = Measured(monkeypatch, UNKNOWN, corrected, corrected)
    prepared = FramePreparation(clock=measured.clock)
    assert prepared.of(FRAME) is FRAME
    for _ in range(5):
        right = prepared.of(FRAME)
        assert np.array_equal(right.depth, DEPTH[:, ::-1])
        assert right.origin.notes == (corrected.note,)
    assert measured.count == 3


def test_one_frame_alone_does_not_overturn_what_was_found(monkeypatch, corrected):
    measured = Measured(monkeypatch, AGREES, corrected, AGREES, corrected, corrected)
    prepared = FramePreparation(clock=measured.clock)
    given = []
    for _ in range(5):
        given.append(prepared.of(FRAME) is FRAME)
        prepared.look_closely()
    assert given == [True, True, True, True, False]


def test_doubts_about_one_frame_are_that_frames_alone(monkeypatch):
    measured = Measured(monkeypatch, AGREES, MOVED, AGREES)
    prepared = FramePreparation(clock=measured.clock)
    found = []
    for _ in range(3):
        found += notes(prepared)
        prepared.look_closely()
    assert found == [(), ("moved",), ()]


def test_lasting_doubts_are_on_each_frame(monkeypatch):
    measured = Measured(monkeypatch, UNSURE)
    assert notes(FramePreparation(clock=measured.clock), 4) == [("this or that",)] * 4


def test_what_nothing_fits_is_refused_where_that_is_asked_for(monkeypatch):
    measured = Measured(monkeypatch, REFUSED)
    prepared = FramePreparation(clock=measured.clock)
    assert notes(prepared, 3) == [("nothing fits",), (), ()]
    assert measured.count == 1
    measured.now = 1.5
    assert notes(prepared) == [("nothing fits",)]
    prepared.look_closely()
    assert notes(prepared) == [("nothing fits",)]
    prepared.look_closely(refuse=True)
    with pytest.raises(MismatchedFrameError, match="nothing fits"):
        prepared.of(FRAME)
    assert notes(prepared) == [()]


def test_a_refusal_says_what_was_odd_about_the_frame(monkeypatch):
    monkeypatch.setattr(preparation, "measure_agreement", lambda _: REFUSED)
    prepared = FramePreparation(clock=lambda: 0.0)
    prepared.look_closely(refuse=True)
    with pytest.raises(MismatchedFrameError, match=r"^nothing fits; the calibration has no pose$"):
        prepared.of(FRAME.with_note("the calibration has no pose"))


def test_one_frame_of_a_source_that_agreed_is_not_refused_and_a_second_is(monkeypatch):
    """Somebody who moves, or a curtain, is no reason to send a person away."""
    measured = Measured(monkeypatch, AGREES, REFUSED, AGREES, REFUSED)
    prepared = FramePreparation(clock=measured.clock)
    found = []
    for _ in range(4):
        prepared.look_closely(refuse=True)
        found += notes(prepared)
    assert found == [(), ("nothing fits",), (), ("nothing fits",)]
    prepared.look_closely(refuse=True)
    with pytest.raises(MismatchedFrameError, match="nothing fits"):
        prepared.of(FRAME)


def test_what_tells_nothing_is_not_looked_at_for_ever(monkeypatch):
    measured = Measured(monkeypatch, UNKNOWN)
    prepared = FramePreparation(clock=measured.clock)
    assert all(prepared.of(FRAME) is FRAME for _ in range(20))
    assert measured.count == 5


def test_frames_are_turned_after_they_are_put_right(monkeypatch, corrected):
    measured = Measured(monkeypatch, corrected)
    turned = FramePreparation(90, clock=measured.clock).of(FRAME)
    assert np.array_equal(turned.depth, np.rot90(DEPTH[:, ::-1], -1))
    assert turned.calibration.depth.width == 120
    with pytest.raises(ValueError, match="rotation must be one of"):
        FramePreparation(30)
