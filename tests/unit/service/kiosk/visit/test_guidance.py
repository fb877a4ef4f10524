"""One hint at a time, long enough to be read; the arrow; the ring."""

import pytest

from denseface.service.gate.faults import Fault
from denseface.service.kiosk.page_messages import Arrow
from denseface.service.kiosk.visit.guidance import SHOWN_S, Guidance
from denseface.service.kiosk.visit.options import VisitOptions
from tests.unit.service.kiosk.visit.driving import GOOD, NOBODY, hint


@pytest.fixture
def guidance():
    return Guidance(VisitOptions(), 0.0)


def test_a_hint_is_shown_for_the_time_to_read_it(guidance):
    shown = []
    for index in range(40):
        code = "move_back" if index % 2 else "hold_still"
        guidance.hint(hint(code), index / 10)
        shown.append(guidance.screen(index / 10).hint)
    changes = [index for index in range(1, 40) if shown[index] != shown[index - 1]]
    assert changes
    assert min(b - a for a, b in zip([0, *changes], changes, strict=False)) >= 10 * SHOWN_S


def test_too_close_is_said_before_all_else(guidance):
    guidance.hint(hint("move_back", "one_person", "hold_still"), 0.0)
    shown = guidance.screen(0.0)
    assert (shown.hint, shown.arrow) == ("move_back", Arrow.BACK)


@pytest.mark.parametrize(("code", "arrow"), [
    # Who is told to go to their own left sees themselves, as in a mirror, go to its left.
    ("move_left", Arrow.LEFT), ("move_right", Arrow.RIGHT), ("move_up", Arrow.UP),
    ("move_down", Arrow.DOWN), ("come_closer", Arrow.CLOSER), ("move_back", Arrow.BACK),
    ("hold_still", None), ("a_fault_of_a_newer_service", None)])
def test_the_arrow_is_as_seen_in_a_mirror(guidance, code, arrow):
    guidance.hint(hint(code), 0.0)
    assert guidance.screen(0.0).arrow is arrow


def test_the_ring_fills_while_all_is_well_and_empties_at_once(guidance):
    seen = []
    for index in range(5):
        guidance.hint(GOOD, index / 10)
        seen.append(guidance.screen(index / 10).progress)
    assert seen == sorted(seen)
    assert 0 < seen[0] < seen[-1] == 1
    guidance.hint(hint("hold_still"), 0.5)
    assert guidance.screen(0.5).progress == 0


def test_two_good_samples_have_to_be_apart_with_none_between_them_that_is_not(guidance):
    guidance.hint(GOOD, 0.0)
    guidance.hint(GOOD, 0.1)
    assert not guidance.settled
    guidance.hint(hint("hold_still"), 0.2)
    guidance.hint(GOOD, 0.4)
    assert not guidance.settled
    guidance.hint(GOOD, 0.8)
    assert guidance.settled


def test_what_was_seen_before_an_interruption_counts_no_more(guidance):
    guidance.hint(GOOD, 0.0)
    guidance.forget()
    guidance.hint(GOOD, 5.0)
    assert not guidance.settled
    assert guidance.screen(5.0).progress < 1


def test_of_nobody_no_picture_is_taken_however_long_it_took(guidance):
    for code, can_press in (("nobody", False), ("move_back", True), ("look_here", True)):
        guidance.hint(hint(code, face=False), 99.0)
        shown = guidance.screen(99.0)
        assert (shown.can_press, shown.with_warnings) == (can_press, can_press)
    guidance.hint(GOOD, 99.1)
    shown = guidance.screen(99.1)
    assert (shown.can_press, shown.with_warnings) == (True, False)


def test_every_place_that_a_fault_names_has_its_arrow(guidance):
    for fault in Fault:
        place = fault.name.startswith(("MOVE_", "COME_"))
        guidance.begin_again(0.0)
        guidance.hint(hint(fault.value), 0.0)
        assert (guidance.screen(0.0).arrow is not None) == place


def test_nobody_is_somebody_who_is_not_there(guidance):
    guidance.hint(NOBODY, 0.0)
    assert guidance.nobody
    guidance.hint(GOOD, 0.1)
    assert not guidance.nobody
