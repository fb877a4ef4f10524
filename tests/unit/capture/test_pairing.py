from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from denseface.capture.pairing import HALF_FRAME_US, Pair, Pairer

PERIOD = 33_333


def feed(events, **options) -> tuple[list[Pair], Pairer]:
    pairer = Pairer(**options)
    pairs = [(pairer.add_depth if kind == "d" else pairer.add_color)(stamp, (kind, stamp))
             for kind, stamp in events]
    return [pair for pair in pairs if pair], pairer


@st.composite
def streams(draw) -> list[tuple[str, int]]:
    """Two streams with skew, jitter and losses, in any order of arrival that keeps each's own."""
    length = draw(st.integers(0, 25))
    skew = draw(st.integers(-40_000, 40_000))
    jitter = st.integers(-3_000, 3_000)
    events = {}
    for kind, offset in (("d", 100_000 + skew), ("c", 100_000)):
        kept = draw(st.lists(st.booleans(), min_size=length, max_size=length))
        events[kind] = [(kind, offset + i * PERIOD + draw(jitter)) for i, k in enumerate(kept) if k]
    merged = []
    while events["d"] or events["c"]:
        first = draw(st.sampled_from([kind for kind in "dc" if events[kind]]))
        merged.append(events[first].pop(0))
    return merged


@given(streams(), st.integers(1, 5))
@settings(deadline=None)
def test_pairs_are_close_in_order_and_nothing_is_lost_uncounted(events, capacity):
    pairs, pairer = feed(events, capacity=capacity)
    for pair in pairs:
        assert abs(pair.depth_us - pair.color_us) <= HALF_FRAME_US
        assert pair.depth == ("d", pair.depth_us)
        assert pair.color == ("c", pair.color_us)
    for a, b in pairwise(pairs):
        assert a.depth_us < b.depth_us
        assert a.color_us < b.color_us
    depth, color = len(pairer.depth.items), len(pairer.color.items)
    assert depth <= capacity
    assert color <= capacity
    given_depth = sum(kind == "d" for kind, _ in events)
    assert given_depth == len(pairs) + pairer.depth.dropped + depth
    assert len(events) - given_depth == len(pairs) + pairer.color.dropped + color


@given(st.integers(1, 40), st.integers(-10_000, 10_000), st.data())
@settings(deadline=None)
def test_every_frame_finds_its_partner_when_none_is_lost(length, skew, data):
    jitter = st.integers(-1_500, 1_500)
    events = sorted(
        (100_000 + i * PERIOD + offset + data.draw(jitter), kind)
        for i in range(length) for kind, offset in (("c", 0), ("d", skew)))
    pairs, pairer = feed([(kind, stamp) for stamp, kind in events])
    assert len(pairs) == length
    assert pairer.depth.dropped == pairer.color.dropped == 0
    assert all(abs(pair.depth_us - pair.color_us - skew) <= 3_000 for pair in pairs)


@given(st.integers(2, 30), st.sets(st.integers(0, 29)), st.sets(st.integers(0, 29)))
@settings(deadline=None)
def test_a_kinect_that_loses_frames_pairs_all_that_still_have_a_partner(length, no_depth, no_color):
    events = []
    for i in range(length):
        if i not in no_color:
            events.append(("c", i * PERIOD))
        if i not in no_depth:
            events.append(("d", i * PERIOD + 11_700))
    pairs, _ = feed(events)
    whole = [i for i in range(length) if i not in no_depth | no_color]
    assert [pair.color_us for pair in pairs] == [i * PERIOD for i in whole]
    assert all(pair.depth_us - pair.color_us == 11_700 for pair in pairs)


def test_the_nearest_partner_is_taken():
    pairs, pairer = feed([("c", 1_000), ("c", 12_000), ("d", 14_000)])
    assert [(pair.color_us, pair.depth_us) for pair in pairs] == [(12_000, 14_000)]
    assert pairer.color.dropped == 1


def test_a_clock_that_starts_over_is_followed():
    pairs, pairer = feed([("d", 900_000), ("d", 10), ("c", 20), ("c", 900_001)])
    assert [(pair.depth_us, pair.color_us) for pair in pairs] == [(10, 20)]
    assert pairer.depth.dropped == 1


def test_clear_drops_what_waits():
    pairer = Pairer()
    pairer.add_depth(5, "old")
    pairer.clear()
    assert pairer.add_color(6, "new") is None
    assert pairer.depth.dropped == 1


@pytest.mark.parametrize("options", [{"tolerance_us": -1}, {"capacity": 0}])
def test_senseless_limits_are_refused(options):
    with pytest.raises(ValueError, match=next(iter(options))):
        Pairer(**options)
