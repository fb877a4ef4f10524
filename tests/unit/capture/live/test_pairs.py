"""What belongs together is paired, whatever the clocks say, and the skew is said honestly."""

import pytest

from denseface.capture.live.pairs import LivePair, LivePairs, PairLog
from denseface.capture.live.ring import Ring
from tests.unit.capture.live.streams import START_S, Stream, paired

SENSORS = {
    "30 fps": (Stream(), Stream(seed=2)),
    "a Kinect's skew": (Stream(first_s=0.0317), Stream(seed=2)),
    "60 and 30 fps": (Stream(fps=60), Stream(seed=2)),
    "30 and 60 fps": (Stream(), Stream(fps=60, seed=2)),
    "60 and 15 fps": (Stream(fps=60), Stream(fps=15, seed=2)),
    "15 fps, half a period apart": (Stream(fps=15, first_s=0.0533), Stream(fps=15, seed=2)),
    "color half a second ahead": (Stream(), Stream(ahead_s=0.5, seed=2)),
    "color a second ahead": (Stream(), Stream(ahead_s=1.0, seed=2)),
    "color a second behind": (Stream(), Stream(ahead_s=-1.0, seed=2)),
    "color since 1970": (Stream(), Stream(ahead_s=1.8e9, seed=2)),
    "no stamps": (Stream(stamp=lambda _: 0), Stream(stamp=lambda _: 0, seed=2)),
    "no color stamps": (Stream(), Stream(stamp=lambda _: 0, seed=2)),
    "milliseconds": tuple(Stream(stamp=lambda us: us / 1000, seed=n) for n in (1, 2)),
    "color in milliseconds": (Stream(), Stream(stamp=lambda us: us / 1000, seed=2)),
    "two pipelines": (Stream(transport_s=0.06), Stream(transport_s=0.02, seed=2)),
    "color drifts": (Stream(), Stream(drift_ppm=300, seed=2)),
    "color jumps": (Stream(), Stream(stamp=lambda us: us + 7e5 * (us > 3e6), seed=2)),
    "both jump": tuple(Stream(stamp=lambda us: us + 7e5 * (us > 3e6), seed=n) for n in (1, 2)),
    "starts over": tuple(Stream(stamp=lambda us: us % 3_000_000, seed=n) for n in (1, 2)),
    "frames are lost": (Stream(lost=frozenset(range(0, 150, 7))),
                        Stream(lost=frozenset(range(3, 150, 11)), seed=2)),
}


@pytest.mark.parametrize("name", SENSORS)
def test_partners_are_the_nearest_and_no_pair_is_older_than_said(name):
    depth, color = SENSORS[name]
    found, pairs = paired(depth, color)
    fast_s, slow_s = sorted((1 / depth.fps, 1 / color.fps))
    assert len(found) >= 0.75 * 5 / slow_s
    nearest_s = slow_s / 2 if fast_s == slow_s else fast_s / 2
    # Where arrivals decide, two that are about as near may be mistaken.
    spread_s = depth.delay_s + color.delay_s + abs(depth.transport_s - color.transport_s)
    for depth_s, color_s, pair in found[20:]:
        loose_s = 2e-3 if pair.skew_known_by == "stamps" else spread_s
        assert abs(depth_s - color_s) <= nearest_s * 1.06 + loose_s
        assert pair.earliest_s <= min(depth_s, color_s) + 2e-3
        assert (pair.depth_us - pair.color_us) / 1e6 == pytest.approx(
            depth_s - color_s, abs=loose_s)
    assert pairs.period_s == pytest.approx(slow_s, rel=0.15)


@pytest.mark.parametrize(("name", "known_by", "note"), [
    ("30 fps", "stamps", ""), ("milliseconds", "stamps", ""), ("two pipelines", "stamps", ""),
    ("color half a second ahead", "arrival",
     "the color stream's clock is 500 ms ahead of the depth stream's: paired by arrival"),
    ("color a second behind", "arrival",
     "the color stream's clock is 1000 ms behind the depth stream's: paired by arrival"),
    ("no stamps", "arrival", "the depth stream's time stamps do not advance and the color stream's "
     "time stamps do not advance: times are known by arrival"),
    ("no color stamps", "arrival",
     "the color stream's time stamps do not advance: times are known by arrival")])
def test_how_the_skew_is_known_is_said(name, known_by, note):
    (*_, (_, _, pair)), _ = paired(*SENSORS[name])
    assert pair.skew_known_by == known_by
    assert [one.replace("499 ms", "500 ms").replace("501 ms", "500 ms")
            .replace("999 ms", "1000 ms").replace("1001 ms", "1000 ms")
            for one in pair.notes] == ([note] if note else [])


def test_the_exposure_is_known_by_stamps_where_only_the_clocks_differ():
    (*_, (_, _, pair)), _ = paired(*SENSORS["color a second ahead"])
    assert (pair.exposure_known_by, pair.skew_known_by) == ("stamps", "arrival")


def test_a_sensor_without_color_gives_each_depth_image():
    pairs = LivePairs({"depth": START_S})
    ring = Ring(3, 8)
    found = []
    for _, stamp_us, arrival_s in Stream().frames(1.0):
        slot = ring.claim()
        assert slot is not None
        pair = pairs.add("depth", slot, stamp_us, arrival_s)
        assert pair is not None
        found.append(pair)
        pair.release()
    assert [pair.number for pair in found] == list(range(1, 31))
    assert found[-1].color is None
    assert (found[-1].skew_known_by, pairs.skew_us) == ("", 0)


def frozen_after(frames, values):
    """Give how many of a single stream's images count as new."""
    pairs = LivePairs({"depth": START_S})
    ring = Ring(3, 1000)
    found = 0
    for (_, stamp_us, arrival_s), value in zip(Stream().frames(frames / 30), values, strict=True):
        slot = ring.claim()
        assert slot is not None
        slot.memory[:] = value
        if pair := pairs.add("depth", slot, stamp_us, arrival_s):
            found += 1
            pair.release()
    return found, pairs.repeats


def test_the_same_image_under_new_stamps_is_not_new():
    assert frozen_after(60, [*range(1, 31), *[30] * 30]) == (30, 30)


def test_a_stream_that_thaws_is_new_again():
    assert frozen_after(60, [*range(1, 31), *[30] * 10, *range(31, 51)]) == (50, 10)


@pytest.mark.parametrize("values", [[7] * 60, [*range(1, 31), *[0] * 30], [1, 1, 2, 2] * 15])
def test_a_sensor_without_noise_or_with_a_covered_lens_is_not_frozen(values):
    assert frozen_after(60, values) == (60, 0)


def pair(ring, number, earliest_s):
    slot = ring.claim()
    assert slot is not None
    return LivePair(number, slot, None, 0, 0, earliest_s, earliest_s, "stamps", "")


def test_the_log_keeps_the_newest_and_gives_the_oldest_that_is_new_enough():
    ring, log = Ring(5, 8), PairLog()
    for number in range(1, 21):
        log.add(pair(ring, number, float(number)))
    newest, first = log.newest(), log.first_after(17.5)
    assert newest is not None
    assert first is not None
    assert (newest.number, first.number) == (20, 18)
    assert log.first_after(20.5) is None
    log.clear()
    assert len(ring.free) == 3  # two are still held by us
    newest.release()
    first.release()
    assert len(ring.free) == 5
    assert log.newest() is None


def test_waiting_for_a_pair_after_another():
    log = PairLog()
    log.add(pair(Ring(1, 8), 3, 1.0))
    assert log.wait(2, 0.0)
    assert not log.wait(3, 0.0)
