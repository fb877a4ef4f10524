"""The simulated schedule says what can be said without it, where one part alone is the limit."""

from dataclasses import replace

import pytest

from bench.scaling_simulation import Costs, Fleet, simulate, sized

FREE = Costs(scheduler=0.0, client=0.0, client_row=0.0, worker=0.0, way=0.0)


def test_where_nothing_costs_anything_all_workers_work():
    found = simulate(Fleet(10, 0.02), FREE, 1000)
    assert found.steady == pytest.approx(1, abs=0.02)
    assert found.seconds == pytest.approx(1000 * 16 * 0.02 / 10, rel=0.05)
    assert (found.scheduler, found.client, found.lost) == (0, 0, 0)


@pytest.mark.parametrize("costs", [
    replace(FREE, scheduler=0.01), replace(FREE, client=0.01),
    replace(FREE, client_row=0.01 / 16)])
def test_the_slowest_of_those_that_do_one_thing_after_the_other_sets_the_pace(costs):
    found = simulate(Fleet(100, 0.02), costs, 1000)
    assert found.seconds == pytest.approx(1000 * 0.01, rel=0.05)
    assert max(found.scheduler, found.client) > 0.95


def test_cores_that_all_share_are_a_limit():
    own = simulate(Fleet(2, 0.0, frames_a_task=1), replace(FREE, worker=0.01), 200)
    shared = simulate(Fleet(2, 0.0, frames_a_task=1), replace(FREE, worker=0.01), 200, cores=1)
    assert (own.seconds, shared.seconds) == pytest.approx((1.0, 2.0), rel=0.05)


def test_a_slow_worker_does_less_and_a_dead_ones_tasks_are_done_by_others():
    fleet = Fleet(10, 0.02)
    slow = simulate(replace(fleet, slow_share=0.1), FREE, 1000)
    assert slow.steady == pytest.approx(0.9 + 0.1 / 3, abs=0.02)
    dying = simulate(replace(fleet, dies_each_s=20, back_after_s=2), FREE, 1000)
    assert dying.lost > 5
    assert 0.75 < dying.steady < 20 / 22 + 0.02


def test_given_times_are_those_that_are_taken():
    assert simulate(Fleet(1, 0.1), FREE, 3, times_s=[1.0, 2.0, 4.0]).seconds == pytest.approx(7)
    assert sized(Fleet(1, 0.05), 0.35).frames_a_task == 7
