"""How long something is kept, whatever the clocks do."""

import pytest

from denseface.service.storage._store_clock import StoreClock, SystemClock
from tests.unit.service.clocks import FakeClock

DAY = 86400.0


def test_time_is_counted_whatever_the_wall_clock_says():
    clock = FakeClock()
    store_clock = StoreClock(clock, None)
    clock.pass_time(10)
    clock.set_wall(400 * DAY)
    clock.pass_time(10)
    clock.set_wall(-800 * DAY)
    assert store_clock.now() == 20


def test_a_hub_that_was_stopped_counts_on():
    clock = FakeClock()
    saved = StoreClock(clock, None).save()
    clock.pass_time(100)
    clock.set_wall(400 * DAY)
    store_clock = StoreClock(clock, saved)
    assert store_clock.now() == 100
    assert store_clock.trusted(DAY)


def test_the_time_switched_off_is_the_wall_clock_s():
    clock = FakeClock()
    saved = StoreClock(clock, None).save()
    clock.restart(off_s=600)
    assert StoreClock(clock, saved).now() == pytest.approx(600, abs=1)
    assert StoreClock(clock, saved).trusted(DAY)


def test_a_clock_far_ahead_after_a_start_waits_for_someone_to_see_it():
    clock = FakeClock()
    saved = StoreClock(clock, None).save()
    clock.restart(off_s=400 * DAY)
    store_clock = StoreClock(clock, saved)
    assert not store_clock.trusted(DAY)
    clock.pass_time(3600)
    assert store_clock.trusted(DAY)


def test_a_clock_that_starts_in_the_past_makes_no_store_younger():
    clock = FakeClock()
    store_clock = StoreClock(clock, None)
    clock.pass_time(50)
    saved = store_clock.save()
    clock.restart(off_s=-400 * DAY)
    assert StoreClock(clock, saved).now() == 50


@pytest.mark.parametrize("saved", [
    "x", "{}", "[]", '{"seconds": 1, "wall": "x", "boot": "b", "at": 1}',
    '{"seconds": NaN, "wall": "2026-01-01T00:00:00+00:00", "boot": "b", "at": 1}',
    '{"seconds": 1, "wall": "2026-01-01T00:00:00", "boot": "b", "at": 1}'])
def test_a_damaged_state_is_named(saved):
    with pytest.raises(ValueError, match="saved clock"):
        StoreClock(FakeClock(), saved)


def test_this_machine_has_such_clocks():
    store_clock = StoreClock(SystemClock(), StoreClock(SystemClock(), None).save())
    assert store_clock.gap_s == 0
    assert 0 <= store_clock.now() < 60
