"""The disk fails at one file operation after another, and the power is cut: what was said stays.

A part of what `script/chaos --disk` plays in full.
"""

import shutil
from pathlib import Path

import pytest

from tests.chaos.disk import FOREVER, Sweep, compile_faults, memory_folder

pytestmark = pytest.mark.timeout(300)  # seconds each, but for a machine that is busy otherwise


@pytest.fixture(scope="module")
def sweep():
    if shutil.which("cc") is None:
        pytest.skip("there is no C compiler (cc) to build the library that makes operations fail")
    with memory_folder() as folder:
        one = Sweep(compile_faults(Path(folder)), Path(folder))
        yield one
        one.close()


@pytest.mark.parametrize(("error", "count", "first"), [
    ("EIO", 1, 0), ("EIO", 4, 2), ("EIO", FOREVER, 4), ("ENOSPC", 1, 6), ("ENOSPC", FOREVER, 8)])
def test_whatever_operation_fails_what_was_said_stays_true(sweep, error, count, first):
    operations = sweep.operations()
    assert operations > 100
    assert sweep.failing(error, count, range(first, operations, 10)) == []


@pytest.mark.parametrize(("error", "count", "first"), [("EIO", 1, 0), ("EIO", FOREVER, 5)])
def test_a_start_on_a_disk_that_fails_loses_nothing(sweep, error, count, first):
    assert sweep.failing(error, count, range(first, sweep.operations(1), 10), hub=1) == []


def test_whenever_the_power_is_cut_what_was_said_stays_true(sweep):
    assert sweep.power_cuts(every=31) == []


def test_a_sync_that_failed_is_not_relied_upon_when_the_power_is_cut(sweep):
    for failing in sweep.syncs()[10:-9:9]:
        assert sweep.power_cuts(every=200, failing=failing) == []


def test_a_sync_that_failed_before_a_kill_is_made_good_by_the_next_hub(sweep):
    for failing in sweep.syncs()[-9:]:
        assert sweep.power_cuts(every=87, failing=failing) == []
