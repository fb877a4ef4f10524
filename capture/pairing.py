"""Pairing of depth and colour by the sensor's time stamps.

The two cameras of a sensor are not exposed together (a Kinect v1's stamps lie 12 ms apart), frames
of either may be lost, and the order of arrival means nothing. Two frames belong together when
their stamps differ by no more than a tolerance of about half a frame period.
"""

from collections import deque
from dataclasses import dataclass
from typing import Generic, TypeVar

__all__ = ["HALF_FRAME_US", "Pair", "Pairer"]

HALF_FRAME_US = 17_000
"""Half a frame period at 30 frames a second, microseconds, rounded up."""

_CAPACITY = 4
"""Items of a stream that wait for a partner, at most."""

D = TypeVar("D")  # depth
C = TypeVar("C")  # colour
T = TypeVar("T")  # either
_Queue = deque[tuple[int, T]]


@dataclass(frozen=True)
class Pair(Generic[D, C]):
    """A depth and a colour item with their stamps, sensor clock, microseconds."""

    depth: D
    color: C
    depth_us: int
    color_us: int


class Pairer(Generic[D, C]):
    """Match two streams as they come in; what finds no partner is dropped and counted.

    Parameters
    ----------
    tolerance_us : the largest difference of two stamps that belong together, microseconds
    capacity : how many items of a stream wait at most; the oldest is dropped beyond that
    """

    def __init__(self, tolerance_us: int = HALF_FRAME_US, capacity: int = _CAPACITY) -> None:
        if tolerance_us < 0:
            raise ValueError(f"tolerance_us must not be negative, got {tolerance_us}")
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.tolerance_us = tolerance_us
        self.capacity = capacity
        self.dropped_depth = 0
        self.dropped_color = 0
        self._depth: _Queue[D] = deque()
        self._color: _Queue[C] = deque()
        self._last_depth_us: int | None = None
        self._last_color_us: int | None = None

    @property
    def waiting(self) -> tuple[int, int]:
        """How many depth and colour items wait for a partner."""
        return len(self._depth), len(self._color)

    def add_depth(self, stamp_us: int, item: D) -> Pair[D, C] | None:
        """Take a depth item; give the pair that it completes, if any."""
        self._restart_if(self._last_depth_us is not None and stamp_us <= self._last_depth_us)
        self._last_depth_us = stamp_us
        at = self._nearest(self._color, stamp_us)
        if at is None:
            self.dropped_depth += _push(self._depth, (stamp_us, item), self.capacity)
            return None
        color_us, color = self._color[at]
        self.dropped_color += _discard(self._color, at + 1) - 1
        self.dropped_depth += _discard(self._depth, len(self._depth))
        return Pair(item, color, stamp_us, color_us)

    def add_color(self, stamp_us: int, item: C) -> Pair[D, C] | None:
        """Take a colour item; give the pair that it completes, if any."""
        self._restart_if(self._last_color_us is not None and stamp_us <= self._last_color_us)
        self._last_color_us = stamp_us
        at = self._nearest(self._depth, stamp_us)
        if at is None:
            self.dropped_color += _push(self._color, (stamp_us, item), self.capacity)
            return None
        depth_us, depth = self._depth[at]
        self.dropped_depth += _discard(self._depth, at + 1) - 1
        self.dropped_color += _discard(self._color, len(self._color))
        return Pair(depth, item, depth_us, stamp_us)

    def clear(self) -> None:
        """Drop what waits, as at a press: what comes next is newer."""
        self.dropped_depth += _discard(self._depth, len(self._depth))
        self.dropped_color += _discard(self._color, len(self._color))
        self._last_depth_us = self._last_color_us = None

    def _restart_if(self, backwards: bool) -> None:
        """A stamp that does not grow means that the sensor's clock started over."""
        if backwards:
            self.clear()

    def _nearest(self, queue: _Queue[T], stamp_us: int) -> int | None:
        best = min(range(len(queue)), key=lambda i: abs(queue[i][0] - stamp_us), default=None)
        if best is None or abs(queue[best][0] - stamp_us) > self.tolerance_us:
            return None
        return best


def _push(queue: _Queue[T], entry: tuple[int, T], capacity: int) -> int:
    """Append and give how many of the oldest had to go."""
    queue.append(entry)
    return _discard(queue, len(queue) - capacity)


def _discard(queue: _Queue[T], count: int) -> int:
    """Take away the oldest `count` and give how many that were."""
    count = max(count, 0)
    for _ in range(count):
        queue.popleft()
    return count
