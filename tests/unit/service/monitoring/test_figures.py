"""Histograms of times."""

import pytest

from denseface.service.monitoring.figures import BUCKETS_S, Histogram, Latencies


def test_each_time_falls_into_the_bucket_that_ends_at_or_above_it():
    one = Histogram()
    for seconds in (0.001, 0.0011, 59.0, 61.0):
        one.add(seconds)
    assert one.counts[0] == one.counts[1] == one.counts[-2] == one.counts[-1] == 1
    assert one.count == 4
    assert one.total_s == pytest.approx(120.0021)


def test_quantiles_are_linear_within_a_bucket():
    one = Histogram()
    for _ in range(100):
        one.add(0.3)
    assert one.quantile_s(0.5) == pytest.approx(0.375)
    assert one.quantile_s(1.0) == 0.5
    assert Histogram().quantile_s(0.5) == 0.0
    for _ in range(300):
        one.add(1e6)
    assert one.quantile_s(0.5) == BUCKETS_S[-1]


def test_a_picture_of_all_stages_does_not_change_any_more():
    latencies = Latencies()
    latencies.observe("a", 1.0)
    before = latencies.stages()
    latencies.observe("a", 1.0)
    assert (before["a"].count, latencies.stages()["a"].count) == (1, 2)


def test_stages_named_by_others_are_limited_and_negative_times_left_out():
    latencies = Latencies()
    for number in range(1000):
        latencies.observe(f"stage{number}", 1.0)
    latencies.observe("stage0", -1.0)
    assert len(latencies.stages()) == 32
    assert latencies.stages()["stage0"].count == 1
