import numpy as np
import pytest

from denseface.capture.oni.order import color_lag_us
from denseface.capture.oni.records import DEPTH_NODE, IMAGE_NODE

PERIOD = 33_333
KINDS = {"d": DEPTH_NODE, "c": IMAGE_NODE}


def lag(order: str, skew_us: int = 0, lost: tuple[int, ...] = (), period_us: int = PERIOD,
        jitter_us: int = 0) -> int:
    """Give the lag of a recording with frames in that order, each stream's stamps from 0."""
    rng = np.random.default_rng(1)
    count = {"d": 0, "c": 0}
    kinds, stamps = [], []
    for number, letter in enumerate(order):
        if number not in lost:
            kinds.append(KINDS[letter])
            stamps.append(100_000 + count[letter] * period_us + (skew_us if letter == "c" else 0)
                          + int(rng.integers(-jitter_us, jitter_us + 1)))
        count[letter] += 1
    return color_lag_us(kinds, stamps)


@pytest.mark.parametrize("order", [
    "dcdcdc", "cdcdcd", "dcdcdcd", "dccddccddc", "dcddccdcddcc", "d", "c", "", "dddd", "cccc",
    "dc", "cd", "ddcc", "ccdd", "dddccc", "cccddd", "dddddccccc", "dcdcdc" * 100,
])
def test_a_clean_recording_has_no_lag(order):
    assert lag(order, jitter_us=2_000) == 0


@pytest.mark.parametrize("skew_us", [-16_000, -12_000, 11_700, 16_000])
@pytest.mark.parametrize("order", ["dcdcdcdc", "cdcdcdcd"])
def test_cameras_half_a_period_apart_are_no_lag(order, skew_us):
    assert lag(order, skew_us) == 0


@pytest.mark.parametrize("late", [1, 2, 3, 10, 30])
@pytest.mark.parametrize("pairs", [2, 4, 40])
def test_color_began_late(late, pairs):
    assert lag("d" * late + "dc" * pairs) == late * PERIOD
    assert lag("d" * late + "cd" * pairs) in (late * PERIOD, (late - 1) * PERIOD)


@pytest.mark.parametrize("late", [2, 3, 30])
def test_one_pair_of_a_stream_that_began_late(late):
    assert lag("d" * late + "dc") == late * PERIOD
    assert lag("c" * late + "cd") == -late * PERIOD


@pytest.mark.parametrize("late", [1, 3, 30])
def test_depth_began_late(late):
    assert lag("c" * late + "cd" * 8) == -late * PERIOD


def test_lost_frames_do_not_hide_a_lag():
    order = "ddd" + "dc" * 20
    assert lag(order, lost=(9, 10, 17, 24), jitter_us=1_500) == pytest.approx(3 * PERIOD, abs=9_000)


def test_lost_frames_are_no_lag():
    assert lag("dc" * 20, lost=(9, 11, 13, 15, 17, 24), jitter_us=1_500) == 0


def test_half_as_many_colors():
    order = "ddc" * 20
    kinds = [KINDS[letter] for letter in order]
    stamps = [i // 3 * 66_666 + 33_333 * (i % 3 == 1) for i in range(len(order))]
    assert color_lag_us(kinds, stamps) == 0
