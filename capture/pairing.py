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

D = TypeVar("D")
C = TypeVar("C")
T = TypeVar("T")
U = TypeVar("U")


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
        self._depth: _Stream[D] = _Stream()
        self._color: _Stream[C] = _Stream()

    @property
    def waiting(self) -> tuple[int, int]:
        """How many depth and colour items wait for a partner."""
        return len(self._depth.items), len(self._color.items)

    @property
    def dropped_depth(self) -> int:
        """How many depth items found no partner."""
        return self._depth.dropped

    @property
    def dropped_color(self) -> int:
        """How many colour items found no partner."""
        return self._color.dropped

    def add_depth(self, stamp_us: int, item: D) -> Pair[D, C] | None:
        """Take a depth item; give the pair that it completes, if any."""
        partner = self._add(self._depth, self._color, stamp_us, item)
        return partner and Pair(item, partner[1], stamp_us, partner[0])

    def add_color(self, stamp_us: int, item: C) -> Pair[D, C] | None:
        """Take a colour item; give the pair that it completes, if any."""
        partner = self._add(self._color, self._depth, stamp_us, item)
        return partner and Pair(partner[1], item, partner[0], stamp_us)

    def clear(self) -> None:
        """Drop what waits, as at a press: what comes next is newer."""
        for stream in (self._depth, self._color):
            stream.drop(len(stream.items))
            stream.last_us = None

    def _add(
        self, own: "_Stream[T]", other: "_Stream[U]", stamp_us: int, item: T
    ) -> tuple[int, U] | None:
        """Take the nearest partner from the other stream, or let the item wait."""
        if own.last_us is not None and stamp_us <= own.last_us:
            self.clear()  # the sensor's clock started over
        own.last_us = stamp_us
        distances = [abs(other_us - stamp_us) for other_us, _ in other.items]
        if not distances or min(distances) > self.tolerance_us:
            own.items.append((stamp_us, item))
            own.drop(len(own.items) - self.capacity)
            return None
        other.drop(distances.index(min(distances)))
        own.drop(len(own.items))
        return other.items.popleft()


class _Stream(Generic[T]):
    """What waits of one stream, oldest first, with its stamps."""

    def __init__(self) -> None:
        self.items: deque[tuple[int, T]] = deque()
        self.last_us: int | None = None
        self.dropped = 0

    def drop(self, count: int) -> None:
        """Drop the oldest `count`, if any."""
        for _ in range(count):
            self.items.popleft()
            self.dropped += 1
