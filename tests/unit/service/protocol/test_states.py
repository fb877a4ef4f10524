"""The table of a capture's life, and that nothing in the service changes a state without it."""

import ast
from pathlib import Path

import pytest

import denseface.service
from denseface.service.protocol.states import (
    IN_MEMORY,
    TRANSITIONS,
    CaptureEvent,
    CaptureState,
    TransitionError,
    advance,
)

ENDS = {CaptureState.REMOVED, CaptureState.REFUSED}
READING = {"get", "select", "select_one", "select_ids"}
"""What may be given a state besides `advance`: they change nothing."""


def modules():
    root = Path(denseface.service.__file__).parent
    for path in sorted(root.rglob("*.py")):
        if path.name != "states.py":
            yield path.relative_to(root), ast.parse(path.read_text())


def members(tree, kind):
    return [node for node in ast.walk(tree) if isinstance(node, ast.Attribute)
            and isinstance(node.value, ast.Name) and node.value.id == kind.__name__
            and node.attr in kind.__members__]


def test_every_state_but_the_ends_can_be_left_and_every_one_reached():
    assert {state for state, _ in TRANSITIONS} == {None, *CaptureState} - ENDS
    reached = {None}
    for _ in CaptureState:
        reached |= {after for (before, _), after in TRANSITIONS.items() if before in reached}
    assert reached == {None, *CaptureState}


def test_what_was_accepted_ends_and_is_never_refused():
    reached = {CaptureState.ACCEPTED}
    for _ in CaptureState:
        reached |= {after for (before, _), after in TRANSITIONS.items() if before in reached}
    assert reached == set(CaptureState) - {
        CaptureState.PRESSED, CaptureState.SAVING_FRAME, CaptureState.REFUSED}


def test_an_outcome_stands_until_it_expires():
    for outcome in (CaptureState.DONE, CaptureState.FAILED, CaptureState.DEAD):
        assert advance(outcome, CaptureEvent.EXPIRED) is CaptureState.REMOVED
        for event in (CaptureEvent.RESULT, CaptureEvent.REJECTED, CaptureEvent.DISPATCHED):
            with pytest.raises(TransitionError, match=f"{outcome.value} cannot be"):
                advance(outcome, event)


@pytest.mark.parametrize(("state", "event"), [
    (CaptureState.ACCEPTED, CaptureEvent.EXPIRED),
    (CaptureState.SAVING_FRAME, CaptureEvent.PURGED),  # the hub waits for the disk first
    (None, CaptureEvent.FRAME_SAVED),
])
def test_what_is_not_in_the_table_is_a_fault(state, event):
    with pytest.raises(TransitionError, match=f"cannot be {event}"):
        advance(state, event)


def test_a_restart_forgets_no_state_that_follows_an_outcome():
    outcomes = {CaptureState.DONE, CaptureState.FAILED, CaptureState.DEAD}
    assert not IN_MEMORY & {
        after for (before, _), after in TRANSITIONS.items() if before in outcomes}


def test_every_event_of_the_table_is_asked_for_somewhere():
    assert {event for _, event in TRANSITIONS} == set(CaptureEvent)
    asked = {CaptureEvent[node.attr]
             for _, tree in modules() for node in members(tree, CaptureEvent)}
    assert asked == set(CaptureEvent)


def test_no_code_sets_a_state_that_the_table_did_not_give():
    """A member of `CaptureState` is compared, looked up or given to `advance`, and nothing else."""
    elsewhere = []
    for path, tree in modules():
        allowed = set()
        for node in ast.walk(tree):
            if isinstance(node, ast.Compare):
                allowed.update(map(id, ast.walk(node)))
            elif isinstance(node, ast.Call):
                called = node.func.attr if isinstance(node.func, ast.Attribute) else (
                    node.func.id if isinstance(node.func, ast.Name) else "")
                if called in READING | {"advance"}:
                    allowed.update(id(argument) for argument in node.args)
        elsewhere += [f"{path}:{node.lineno}" for node in members(tree, CaptureState)
                      if id(node) not in allowed]
    assert elsewhere == []


def test_no_statement_sets_a_state_by_name():
    """What is written into the column `state` is a parameter: it comes from the table."""
    writing = 0
    for path, tree in modules():
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                before, found, value = node.value.partition("SET state = ")
                if found:
                    writing += 1
                    assert value.startswith("?"), f"{path}:{node.lineno}"
                assert "SET state=" not in before, f"{path}:{node.lineno}"
    assert writing
