"""A frame's exposure is never later than estimated at the earliest, whatever the stamps are."""

from dataclasses import replace

import pytest

from denseface.capture.live.clock import TRANSPORT_S, StampKind, StreamClock
from tests.unit.capture.live.streams import START_S, Stream

PERIOD_S = 1 / 30


def run(stream, seconds=5.0, **options):
    """Give the clock, and of each frame the true exposure and what is known of it."""
    clock = StreamClock(START_S, **options)
    return clock, [(exposed, clock.add(stamp, arrival))
                   for exposed, stamp, arrival in stream.frames(seconds)]


SENSORS = {
    "30 fps": Stream(),
    "60 fps": Stream(fps=60),
    "15 fps": Stream(fps=15),
    "one period in the pipeline": Stream(transport_s=0.033),
    "two periods in the pipeline": Stream(transport_s=0.066),
    "slow to start": Stream(first_s=1.0, transport_s=0.066),
    "a busy machine": Stream(delay_s=0.2, transport_s=0.033),
    "runs fast": Stream(drift_ppm=300),
    "runs slow": Stream(drift_ppm=-300),
    "a second ahead": Stream(ahead_s=1.0),
    "since 1970": Stream(ahead_s=1.8e9),
    "no stamps": Stream(stamp=lambda _: 0, transport_s=0.05),
    "milliseconds": Stream(stamp=lambda us: us / 1000),
    "seconds": Stream(stamp=lambda us: us / 1e6),
    "nanoseconds": Stream(stamp=lambda us: us * 1000, transport_s=0.02),
    "jumps ahead": Stream(stamp=lambda us: us + 7e5 * (us > 3e6)),
    "jumps back": Stream(stamp=lambda us: us - 7e5 * (us > 3e6)),
    "jumps back by half a period": Stream(stamp=lambda us: us - 16_000 * (us > 3e6)),
    "starts over": Stream(stamp=lambda us: us % 2_000_000),
    "stamps end": Stream(stamp=lambda us: us * (us < 3e6)),
    "loses frames": Stream(lost=frozenset(range(0, 150, 7))),
}


@pytest.mark.parametrize("name", SENSORS)
def test_no_frame_is_older_than_its_earliest_exposure(name):
    _, frames = run(SENSORS[name])
    for exposed_s, known in frames:
        assert known is not None
        assert known.earliest_s <= exposed_s + 2e-3  # drift, and stamps in whole milliseconds
        if "half a period" not in name:  # which cannot be told from a lost frame
            assert known.latest_s >= exposed_s - 2e-3


@pytest.mark.parametrize("pipeline_s", [0.0, 0.033, 0.066])
def test_where_a_sensor_starts_fast_the_estimate_is_within_its_start(pipeline_s):
    stream = Stream(transport_s=pipeline_s, first_s=0.01)
    clock, frames = run(stream)
    assert clock.transport_s <= pipeline_s + 0.011 + stream.delay_s
    assert all(exposed - known.earliest_s <= 0.011 + stream.delay_s
               for exposed, known in frames[20:])


def test_a_slow_start_tells_nothing_and_the_longest_transport_is_assumed():
    clock, frames = run(Stream(first_s=1.0, transport_s=0.03))
    assert clock.transport_s == TRANSPORT_S
    assert all(exposed - known.earliest_s == pytest.approx(TRANSPORT_S - 0.03, abs=5e-3)
               for exposed, known in frames[20:])


@pytest.mark.parametrize(("name", "kind"), [
    ("30 fps", StampKind.GOOD), ("no stamps", StampKind.NONE),
    ("milliseconds", StampKind.MILLISECONDS), ("seconds", StampKind.FOREIGN),
    ("nanoseconds", StampKind.FOREIGN), ("since 1970", StampKind.GOOD),
    ("stamps end", StampKind.NONE), ("a busy machine", StampKind.GOOD)])
def test_what_stamps_are_good_for(name, kind):
    clock, frames = run(SENSORS[name])
    assert clock.kind is kind
    assert (frames[-1][1].stamp_s is None) == (kind in (StampKind.NONE, StampKind.FOREIGN))


@pytest.mark.parametrize(("name", "jumps"), [
    ("30 fps", 0), ("a busy machine", 0), ("loses frames", 0), ("runs fast", 0), ("runs slow", 0),
    ("jumps ahead", 1), ("jumps back", 1), ("starts over", 2), ("stamps end", 1)])
def test_jumps_are_counted_and_a_busy_machine_is_none(name, jumps):
    clock, _ = run(SENSORS[name])
    assert clock.jumps == jumps


@pytest.mark.parametrize("fps", [15, 30, 60])
@pytest.mark.parametrize("stamp", [lambda us: us, lambda _: 0])
def test_the_period_is_measured(fps, stamp):
    clock, _ = run(Stream(fps=fps, stamp=stamp))
    assert clock.period_s == pytest.approx(1 / fps, rel=0.1)


def test_missing_frames_are_counted_once_the_period_is_known():
    lost = frozenset({20, 21, 40, 77})
    assert run(Stream(lost=lost))[0].missed == len(lost)
    assert run(Stream())[0].missed == 0


def test_a_frame_that_comes_twice_is_none():
    clock, frames = run(Stream(), 1.0)
    (_, stamp_us, _), *_ = list(Stream().frames(1.0))[::-1]
    assert clock.add(stamp_us, START_S + 1.1) is None
    assert clock.add(stamp_us + 33_333, START_S + 1.1) is not None
    assert clock.frames == len(frames) + 1


def test_without_stamps_no_frame_counts_as_a_repeat():
    clock, frames = run(SENSORS["no stamps"])
    assert clock.frames == len(frames)


def test_drift_is_followed_for_an_hour():
    clock, frames = run(replace(Stream(), drift_ppm=-200, transport_s=0.03), 600)
    errors = [exposed - known.earliest_s for exposed, known in frames[100:]]
    assert min(errors) >= -1e-3
    assert max(errors) < clock.transport_s + 0.01
    assert clock.jumps == 0


def test_a_frame_that_waited_is_older_than_it_seems():
    """Nobody read for a second: what is read then was delivered at any time in between."""
    clock, _ = run(replace(Stream(), stamp=lambda _: 0), 1.0)
    late = clock.add(0, START_S + 2.0)
    assert late is not None
    assert late.earliest_s < START_S + 1.0
    assert late.latest_s == START_S + 2.0


@pytest.mark.parametrize("transport_s", [-0.1, 10])
def test_a_senseless_transport_is_refused(transport_s):
    with pytest.raises(ValueError, match="transport_s"):
        StreamClock(0.0, transport_s)
