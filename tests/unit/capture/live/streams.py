"""Streams of a sensor that is not there: when frames were exposed, stamped, and read."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from random import Random

import numpy as np

from denseface.capture.live.pairs import LivePair, LivePairs
from denseface.capture.live.ring import Ring

START_S = 500.0
"""When the streams are started, monotonic clock."""


@dataclass
class Stream:
    """One stream: when its frames are exposed, and what it says of that."""

    fps: float = 30.0
    first_s: float = 0.02
    """From the start to the first exposure."""
    transport_s: float = 0.0
    delay_s: float = 0.004
    """Longest delay of the machine, seconds; none has a tenth of the frames."""
    drift_ppm: float = 0.0
    ahead_s: float = 0.0
    stamp: Callable[[float], float] = lambda stamp_us: stamp_us
    lost: frozenset[int] = frozenset()
    seed: int = 1

    def frames(self, seconds: float) -> Iterator[tuple[float, int, float]]:
        """Give exposure, stamp and arrival of each frame that is read.

        As in OpenNI2 the newest frame replaces the one that nobody has read yet.
        """
        random = Random(self.seed)
        free_s = START_S
        count = round(seconds * self.fps)
        for number in range(count):
            exposed_s = START_S + self.first_s + number / self.fps
            delay_s = random.random() * self.delay_s if random.random() > 0.1 else 0.0
            arrival_s = max(exposed_s + self.transport_s, free_s) + delay_s
            replaced = arrival_s > exposed_s + 1 / self.fps + self.transport_s
            if number in self.lost or (replaced and number < count - 1):
                continue
            free_s = arrival_s
            stamp_us = 1e6 + (exposed_s - START_S) * (1e6 + self.drift_ppm) + self.ahead_s * 1e6
            yield exposed_s, round(self.stamp(stamp_us)), arrival_s


def paired(depth: Stream, color: Stream, seconds: float = 5.0) -> tuple[
        list[tuple[float, float, LivePair]], LivePairs]:
    """Run both streams through `LivePairs`: true exposures of each pair, and the pair."""
    pairs = LivePairs({"depth": START_S, "color": START_S})
    rings = {kind: Ring(12, 8) for kind in ("depth", "color")}
    events = sorted((arrival, kind, stamp, exposed)
                    for kind, stream in (("depth", depth), ("color", color))
                    for exposed, stamp, arrival in stream.frames(seconds))
    found = []
    for arrival_s, kind, stamp_us, exposed_s in events:
        slot = rings[kind].claim()
        assert slot is not None, "a slot was not given back"
        slot.memory.view(np.float64)[0] = exposed_s
        if pair := pairs.add(kind, slot, stamp_us, arrival_s):
            assert pair.color is not None
            true = [float(one.memory.view(np.float64)[0]) for one in (pair.depth, pair.color)]
            found.append((true[0], true[1], pair))
            pair.release()
    pairs.close()
    assert all(len(ring.free) == 12 for ring in rings.values())
    return found, pairs
