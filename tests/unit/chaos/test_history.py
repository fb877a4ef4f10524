"""The checker of the crash harness catches what it is there for."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from denseface.service.storage import _recovery
from tests.chaos.history import JUMP, Answer, History, Kept, Seen, violations


def good(count: int = 6) -> History:
    """Everything pressed is accepted and seen; the last is a dead letter, one more was refused."""
    ids = [f"c{number}" for number in range(1, count + 1)]
    states = ["done"] * (count - 1) + ["dead"]
    seen = [Seen("e", number, capture_id, state)
            for number, (capture_id, state) in enumerate(zip(ids, states, strict=True), 1)]
    return History(
        pressed=dict.fromkeys(ids, Answer.ACCEPTED) | {"no": Answer.REFUSED,
                                                       "who": Answer.UNKNOWN},
        followed=seen, published=list(seen),
        kept=[Kept(one.capture_id, one.state, one.sequence, True) for one in seen])


def test_a_good_history_passes():
    assert violations(good()) == []


def test_what_nobody_answered_may_exist_or_not():
    history = good()
    history.pressed["c2"] = Answer.UNKNOWN
    assert violations(history) == []


def test_publications_may_be_missing_but_not_what_is_followed():
    history = good()
    del history.published[2]
    assert violations(history) == []
    del history.followed[2]
    assert violations(history) == ["c3: done, and no subscriber saw it"]


def found(history: History, text: str) -> None:
    assert [one for one in violations(history) if text in one], violations(history)


def test_a_lost_capture_is_caught():
    history = good()
    del history.kept[5], history.followed[5], history.published[5]
    assert violations(history) == ["c6: accepted and lost"]


@given(st.integers(0, 5))
def test_any_lost_capture_is_caught(which):
    history = good()
    del history.kept[which], history.followed[which], history.published[which]
    found(history, f"c{which + 1}: accepted and lost")


@given(st.integers(0, 5))
def test_a_doubled_capture_is_caught(which):
    history = good()
    again = replace(history.followed[which], sequence=7)
    history.followed.append(again)
    history.published.append(again)
    history.kept[which] = replace(history.kept[which], sequence=7)
    found(history, f"c{which + 1}: visible 2 times")


def test_a_capture_that_is_kept_twice_is_caught():
    history = good()
    history.kept.append(replace(history.kept[0], sequence=7))
    found(history, "c1: kept 2 times")


def test_an_invented_capture_is_caught_wherever_it_is():
    history = good()
    ghost = Seen("e", 7, "ghost", "done")
    for where in ("followed", "published"):
        one = good()
        getattr(one, where).append(ghost)
        found(one, f"ghost: {where} and never pressed")
    history.kept.append(Kept("ghost", "done", 7, True))
    found(history, "ghost: kept and never pressed")


def test_a_refused_press_that_appears_is_caught():
    history = good()
    history.pressed["c4"] = Answer.REFUSED
    assert violations(history) == ["c4: refused, and yet done"]


@pytest.mark.parametrize("state", ["accepted", "failed", "removed"])
def test_another_end_than_a_face_or_a_dead_letter_is_caught(state):
    history = good()
    history.kept[1] = replace(history.kept[1], state=state)
    found(history, f"c2: ended as {state}")


def test_a_spoiled_file_is_caught_unless_the_run_spoiled_it():
    history = good()
    history.kept[1] = replace(history.kept[1], sound=False)
    assert violations(history) == ["c2: done, but its file is not sound"]
    assert violations(replace(history, damaged=frozenset({"c2"}))) == []


def test_a_wrong_order_and_a_changed_epoch_are_caught():
    history = good()
    history.followed[1], history.followed[2] = history.followed[2], history.followed[1]
    found(history, "c2: number 2 came after 3")
    history = good()
    history.followed[5] = replace(history.followed[5], epoch="f")
    found(history, "c6: the epoch changed")


def test_a_number_of_no_outcome_is_caught_and_a_jump_is_none():
    for step, wrong in ((1, True), (JUMP, False), (JUMP + 1, True), (2 * JUMP, False)):
        history = good()
        later = replace(history.followed[5], sequence=6 + step)
        history.followed[5] = history.published[5] = later
        history.kept[5] = replace(history.kept[5], sequence=6 + step)
        assert bool(violations(history)) is wrong
    assert JUMP == _recovery._SKIPPED_NUMBERS


def test_a_number_published_twice_or_for_two_captures_is_caught():
    history = good()
    history.published.append(history.published[0])
    assert violations(history) == ["number 1 of epoch e was published 2 times"]
    history = good()
    history.published[0] = replace(history.published[0], capture_id="c2")
    found(history, "c2: published as 1, which is c1")


def test_an_outcome_that_changed_after_it_was_seen_is_caught():
    history = good()
    history.kept[0] = replace(history.kept[0], state="dead")
    found(history, "c1: seen as done 1, kept as dead 1")


def test_a_face_made_again_stands_under_its_new_number():
    history = good()
    again = replace(history.followed[0], sequence=7)
    history.followed.append(again)
    history.published.append(again)
    history.kept[0] = replace(history.kept[0], sequence=7)
    assert violations(replace(history, damaged=frozenset({"c1"}))) == []


def test_what_was_said_to_be_removed_and_is_there_is_caught():
    history = good()
    history.pressed["c2"] = Answer.REMOVED
    assert violations(history) == ["c2: removed, and yet done"]


@pytest.mark.parametrize("answer", [Answer.REMOVED, Answer.WITHDRAWN])
def test_what_is_removed_may_have_been_seen(answer):
    history = good()
    history.pressed["c2"] = answer
    del history.kept[1]
    assert violations(history) == []


def test_what_an_operator_asked_for_in_vain_may_be_there():
    history = good()
    history.pressed["c2"] = Answer.WITHDRAWN
    assert violations(history) == []
