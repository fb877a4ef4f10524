"""What the benchmark of the capture asks of a live sensor, in a process of its own.

.venv/bin/python -m bench.capture_probe presses|copies COUNT [TRANSPORT_S], under an `environment`
of the virtual sensor; answers with a line of JSON.
"""

import json
import sys
import threading
import time
import tracemalloc
from dataclasses import asdict, dataclass

import numpy as np

from denseface.capture.live.clock import TRANSPORT_S
from denseface.capture.live.sensor import open_sensor
from denseface.capture.live.states import LiveState
from denseface.capture.openni2 import LiveSource
from tests.virtual_sensor.marks import read_mark

__all__ = ["PRESS_PAUSE_S", "Copies", "PressTimes"]

PRESS_PAUSE_S = 0.15
"""Longest pause between two presses, seconds: they fall on every phase of a frame's period."""
_TRACED_PAIRS = 30
_START_S = 60.0
"""Longest wait for the sensor, seconds."""


@dataclass(frozen=True)
class PressTimes:
    """What one press got, ms."""

    exposed_after: float
    """From the press to the true exposure of the earlier one of both images."""
    skew: float
    """From the true exposure of depth to that of colour."""
    answered_after: float
    """From the press to the frame's being there."""
    estimate_early: float
    """How much earlier than the true exposure the estimate is: none may be later."""


@dataclass(frozen=True)
class Copies:
    """What reading costs."""

    read_ms: float
    """Processor time of the reading thread for a pair."""
    copy_ms: float
    """Of one copy of a pair's bytes."""
    allocated_kb: float
    """Largest memory that was allocated while reading: a second copy would need some."""


def _presses(count: int, transport_s: float) -> list[PressTimes]:
    sensor = open_sensor("openni2:", transport_s=transport_s)
    if sensor is None:
        raise RuntimeError("openni2: is no live sensor")
    changed = threading.Event()
    sensor.on_change = changed.set
    until = time.monotonic() + _START_S
    while sensor.state is not LiveState.STREAMING:
        if time.monotonic() > until:
            raise RuntimeError(f"the sensor does not stream: {sensor.reason}")
        changed.wait(0.1)
    pauses = np.random.default_rng(0).uniform(0, PRESS_PAUSE_S, count)
    taken = []
    for pause_s in pauses:
        time.sleep(float(pause_s))
        pressed_s = time.monotonic()
        changed.clear()
        while (shot := sensor.first_after(pressed_s)) is None:
            changed.wait(1.0)
            changed.clear()
        answered_s = time.monotonic()
        frame = shot.frame
        if frame.color is None:
            raise RuntimeError("the sensor has no colour")
        depth_s = read_mark(frame.depth, unit_um=frame.depth_meaning.unit_um).exposed_ns * 1e-9
        color_s = read_mark(frame.color).exposed_ns * 1e-9
        first_s = min(depth_s, color_s)
        taken.append(PressTimes(*(1e3 * seconds for seconds in (
            first_s - pressed_s, color_s - depth_s, answered_s - pressed_s,
            first_s - shot.earliest_s))))
    sensor.close()
    return taken


def _copies(pairs: int) -> Copies:
    source = LiveSource()
    sizes = [source.streams.frame_bytes(kind) for kind in ("depth", "color")]
    while not source.warm:
        _release(source)
    left, used = pairs, time.thread_time()
    while left:
        left -= _release(source)
    used = time.thread_time() - used
    tracemalloc.start()
    before, left = tracemalloc.get_traced_memory()[0], _TRACED_PAIRS
    while left:
        left -= _release(source)
    allocated = tracemalloc.get_traced_memory()[1] - before
    tracemalloc.stop()
    source.close()
    images = [(np.ones(size, np.uint8), np.ones(size, np.uint8)) for size in sizes]
    start = time.thread_time()
    for _ in range(pairs):
        for out, image in images:
            out[:] = image
    return Copies(1e3 * used / pairs, 1e3 * (time.thread_time() - start) / pairs,
                  allocated / 1000)


def _release(source: LiveSource) -> bool:
    pair = source.poll(1.0)
    if pair is not None:
        pair.release()
    return pair is not None


def main() -> int:
    """Do what is asked."""
    what, count = sys.argv[1], int(sys.argv[2])
    transport_s = float(sys.argv[3]) if sys.argv[3:] else TRANSPORT_S
    print(json.dumps([asdict(one) for one in _presses(count, transport_s)] if what == "presses"
                     else asdict(_copies(count))))
    return 0


if __name__ == "__main__":
    sys.exit(main())
