"""The table of a live sensor's states: no dead end, and nothing takes for ever."""

import pytest

from denseface.capture.live.states import (
    HANG_S,
    PATIENCE_S,
    TRANSITIONS,
    LiveEvent,
    LiveFigures,
    LiveState,
    LiveStates,
)


def reached(start):
    found, due = {start}, [start]
    while due:
        state = due.pop()
        for (before, _), after in TRANSITIONS.items():
            if before is state and after not in found:
                found.add(after)
                due.append(after)
    return found


@pytest.mark.parametrize("state", LiveState)
def test_every_state_can_be_reached_and_leads_back_to_streaming(state):
    assert state in reached(LiveState.ABSENT)
    assert LiveState.STREAMING in reached(state)


@pytest.mark.parametrize("state", LiveState)
def test_in_every_state_the_driver_may_hang_and_that_has_an_end(state):
    assert 0 < HANG_S[state] <= 10


def test_who_waits_for_frames_does_so_within_limits():
    for state in (LiveState.WARMING, LiveState.STALLED):
        assert (state, LiveEvent.LOST) in TRANSITIONS
        states = LiveStates(0.0, state)
        assert not states.overdue(PATIENCE_S[state])
        assert states.overdue(PATIENCE_S[state] + 0.1)
    assert not LiveStates(0.0, LiveState.STREAMING).overdue(1e9)


def test_a_sensor_that_cannot_be_had_stays_blocked_while_it_is_tried_anew():
    states = run(LiveStates(0.0), [(LiveEvent.FOUND, "opened"), (LiveEvent.REFUSED, "busy")], 1.0)
    run(states, [(LiveEvent.REFUSED, "busy"), (LiveEvent.REFUSED, "no permission")], 9.0)
    assert (states.state, states.reason, states.since_s) == (
        LiveState.BLOCKED, "no permission", 1.0)
    assert states.advance(LiveEvent.OPENED, 10.0, "warms up") is LiveState.WARMING


def test_events_out_of_place_are_mistakes_of_ours():
    with pytest.raises(ValueError, match="closed means nothing while absent"):
        LiveStates(0.0).advance(LiveEvent.CLOSED, 1.0)


ROUND = [(LiveEvent.FOUND, "found"), (LiveEvent.OPENED, "warms up"), (LiveEvent.WARM, "")]


def run(states, events, now_s=0.0):
    for event, reason in events:
        states.advance(event, now_s, reason)
    return states


def test_the_reason_is_there_as_long_as_the_sensor_does_not_stream():
    states = run(LiveStates(0.0), ROUND[:2])
    assert states.reason == "warms up"
    run(states, ROUND[2:], 5.0)
    assert (states.state, states.reason, states.since_s) == (LiveState.STREAMING, "", 5.0)
    run(states, [(LiveEvent.SILENT, "silent"), (LiveEvent.FRAME, "")], 6.0)
    assert (states.state, states.reason) == (LiveState.STREAMING, "")
    run(states, [(LiveEvent.LOST, "unplugged"), (LiveEvent.CLOSED, "")], 7.0)
    assert (states.state, states.reason) == (LiveState.ABSENT, "unplugged")


def lose(states, times):
    for now_s in times:
        run(states, [*ROUND, (LiveEvent.LOST, "unplugged"), (LiveEvent.CLOSED, "")], now_s)
    return states.reason


def test_a_loop_of_losses_is_named():
    assert lose(LiveStates(0.0), [1.0, 2.0]) == "unplugged"
    assert lose(LiveStates(0.0), [1.0, 2.0, 3.0]) == (
        "unplugged (lost 3 times and more within a minute: try another cable, port or power "
        "supply)")
    assert lose(LiveStates(0.0), [0.0, 100.0, 200.0, 300.0]) == "unplugged"


def test_figures_of_several_openings_add_up_and_the_skew_is_the_last():
    total = LiveFigures(3, 2, skew_us=5) + LiveFigures(10, 1, reconnects=1, skew_us=-7)
    assert total == LiveFigures(13, 3, reconnects=1, skew_us=-7)
