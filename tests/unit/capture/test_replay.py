import math
import threading
import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from denseface.capture import open_source
from denseface.capture.errors import UnreadableSourceError
from denseface.capture.live.sensor import open_sensor
from denseface.capture.live.states import LiveState
from denseface.capture.npz import save_frame
from denseface.capture.replay import Replay, ReplaySensor, paced
from denseface.capture.source import ReplayOptions
from tests.unit import frames
from tests.waiting import LIMIT_S, until

PERIOD_US = 20_000


def frame(number: int, step_us: int = PERIOD_US):
    made = frames.frame(np.full((120, 160), 700 + number, np.uint16),
                        np.zeros((120, 160, 3), np.uint8))
    return replace(made, depth_timestamp_us=number * step_us,
                   color_timestamp_us=number * step_us + 5_000)


@pytest.fixture
def folder(tmp_path):
    path = tmp_path / "take"
    path.mkdir()
    for number in range(4):
        save_frame(frame(number), path / f"{number:06}.npz")
    return path


def numbers(frames) -> list[int]:
    return [int(frame.depth[0, 0]) - 700 for frame in frames]


@pytest.mark.parametrize(("uri", "name", "options"), [
    ("a.oni", "a.oni", None),
    ("a.oni?rate=real", "a.oni", ReplayOptions(real_time=True)),
    ("a.oni?rate=asked&end=stop", "a.oni", ReplayOptions(stops=True)),
    ("a?b.oni?end=loop&frame=12", "a?b.oni", ReplayOptions(frame=12)),
    ("openni2:", "openni2:", None),
    ("OpenNI2:freenect://0?serial=A00", "OpenNI2:freenect://0?serial=A00", None),
])
def test_options_of_a_uri(uri, name, options):
    assert ReplayOptions.split(uri) == (name, options)


@pytest.mark.parametrize("text", [
    "", "rate", "rate=", "rate=fast", "speed=2", "frame=-1", "frame=x", "frame=99999999999",
    "end=stop&end=stop", "end=stop&", "frame=1.5", "rate=real&loop"])
def test_options_that_are_none(text):
    with pytest.raises(UnreadableSourceError, match=r"a\.oni\?.*expected rate=asked or rate=real"):
        ReplayOptions.split(f"a.oni?{text}")


def test_a_file_with_a_question_mark_in_its_name(tmp_path):
    path = tmp_path / "take?rate=what.npz"
    save_frame(frame(3), path)
    with open_source(path) as source:
        assert numbers(source) == [3]
    with open_source(f"{path}?end=stop") as source:
        assert numbers(source) == [3]


def test_one_frame_of_a_folder(folder):
    with open_source(f"{folder}?frame=2") as source:
        assert (source.frame_count, source.repeats) == (1, True)
        assert numbers(source) == [2]
        assert numbers(source) == [2]
    with pytest.raises(UnreadableSourceError, match=r"has 4 frames \(0 to 3\), frame=4 asks for"):
        open_source(f"{folder}?frame=4")


def test_a_folder_that_is_played_once(folder):
    with open_source(f"{folder}?end=stop") as source:
        assert (source.frame_count, source.repeats) == (4, False)
        assert numbers(source) == [0, 1, 2, 3]


class Clock:
    """Time that passes only where it is waited for."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now

    def wait(self, seconds: float) -> None:
        self.now += seconds


def played(given, *, busy: dict[int, float] | None = None, reading_s: float = 0.0
           ) -> list[tuple[int, float]]:
    """Give number and time of each frame, ms; who asks is busy after some for so many seconds."""
    clock = Clock()

    def read():
        for one in given:
            clock.now += reading_s
            yield one

    seen = []
    for one, _ in paced(read(), wait=clock.wait, clock=clock):
        seen.append((*numbers([one]), round((clock.now - 100) * 1e3)))
        clock.now += (busy or {}).get(seen[-1][0], 0.0)
    return seen


def test_each_frame_comes_at_its_time():
    assert played(map(frame, range(4))) == [(0, 0), (1, 20), (2, 40), (3, 60)]


def test_what_was_due_while_nobody_asked_is_left_out():
    assert played(map(frame, range(10)), busy={1: 0.1}) == [
        (0, 0), (1, 20), (6, 120), (7, 140), (8, 160), (9, 180)]


def test_what_is_read_slowly_is_played_slowly():
    assert numbers_of(played(map(frame, range(5)), reading_s=0.3)) == [0, 1, 2, 3, 4]


def numbers_of(seen) -> list[int]:
    return [number for number, _ in seen]


@pytest.mark.parametrize("second_us", [0, -500_000, 5_000_000])
def test_stamps_that_are_none_or_jump(second_us):
    given = [frame(0), replace(frame(1), depth_timestamp_us=second_us), frame(2, 40_000_000)]
    assert numbers_of(played(given)) == [0, 1, 2]
    assert played(given)[-1][1] < 100


def test_a_folder_is_a_live_sensor(folder):
    sensor = open_sensor(f"{folder}?rate=real")
    assert isinstance(sensor, ReplaySensor)
    try:
        changed = threading.Event()
        sensor.on_change = changed.set
        assert sensor.wait(0, LIMIT_S)
        seen = [until(sensor.latest)]
        for _ in range(8):
            after = math.nextafter(seen[-1].earliest_s, math.inf)
            seen.append(until(lambda after=after: sensor.first_after(after)))
        assert (sensor.state, sensor.reason) == (LiveState.STREAMING, "")
        assert all(a.earliest_s < b.earliest_s for a, b in pairwise(seen))
        assert len(set(numbers(shot.frame for shot in seen))) > 1
        for shot in seen:
            # Depth was taken 5 ms before colour.
            assert shot.latest_s - shot.earliest_s == pytest.approx(0.005, abs=1e-6)
            assert shot.frame.origin.exposure_known_by == "stamps"
        assert sensor.figures.frames >= 9
        assert sensor.figures.skew_us == -5_000
        changed.clear()  # before it asks: who asks is told once
        assert sensor.first_after(math.inf) is None
        assert changed.wait(LIMIT_S), "told when there is one"
        assert until(lambda: sensor.first_after(seen[-1].earliest_s + 0.1))
    finally:
        assert sensor.close(LIMIT_S)


def test_a_live_replay_whose_end_is_slow_goes_on(folder, monkeypatch):
    """As on a busy machine: a recording of one frame would stand still for ever."""
    def slowly(replay):
        yield frame(0)
        time.sleep(0.08)  # longer than a frame's period and a half

    monkeypatch.setattr(Replay, "chosen", slowly)
    sensor = ReplaySensor(f"{folder}?rate=real")
    until(lambda: sensor.figures.frames > 5)
    assert sensor.close(LIMIT_S)


def test_a_live_replay_that_begins_late_begins_with_its_first_frame(folder, monkeypatch):
    """As on a busy machine: all of a short recording was late, and it was said to hold nothing."""
    chosen = Replay.chosen

    def late(replay):
        time.sleep(0.3)  # longer than the recording
        return chosen(replay)

    monkeypatch.setattr(Replay, "chosen", late)
    sensor = ReplaySensor(f"{folder}?rate=real&end=stop")
    until(lambda: sensor.state is LiveState.ABSENT)
    assert sensor.reason.endswith(": the recording is at its end")
    assert sensor.figures.frames > 0
    assert sensor.close(LIMIT_S)


def test_a_live_replay_that_ends(folder, monkeypatch):
    begin, changed = threading.Event(), threading.Event()
    now_s = time.monotonic()

    def played(frames, *start, wait):
        assert begin.wait(LIMIT_S)
        return paced(frames, *start, wait=wait, clock=lambda: now_s)  # none is late

    monkeypatch.setattr("denseface.capture.replay.paced", played)
    sensor = ReplaySensor(f"{folder}?rate=real&end=stop")
    sensor.on_change = changed.set
    begin.set()
    until(lambda: sensor.state is LiveState.ABSENT)
    assert sensor.reason == f"{folder}?rate=real&end=stop: the recording is at its end"
    assert (sensor.latest(), sensor.first_after(0.0)) == (None, None)
    assert sensor.figures.frames == 4
    assert changed.wait(LIMIT_S)
    assert sensor.close(LIMIT_S)


def test_a_live_replay_of_a_file_that_becomes_unreadable(folder):
    (folder / "000001.npz").write_bytes(b"")
    sensor = ReplaySensor(f"{folder}?rate=real")
    until(lambda: sensor.state is LiveState.ABSENT)
    assert "000001.npz" in sensor.reason
    assert sensor.close(LIMIT_S)


def test_no_live_sensor(folder):
    assert open_sensor(str(folder)) is None
    assert open_sensor(f"{folder}?end=stop") is None
    with pytest.raises(UnreadableSourceError, match="no such file"):
        open_sensor(f"{folder}.npz?rate=real")
