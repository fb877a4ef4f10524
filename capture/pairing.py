"""Pairing of depth and colour by the sensor's time stamps.

The two cameras of a sensor are not exposed together (a Kinect v1's stamps lie 12 ms apart), frames
of either may be lost, and the order of arrival means nothing. Two frames belong together when
their stamps differ by no more than a tolerance of about half a frame period.
"""

from collections import deque
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

__all__ = ["HALF_FRAME_US", "Pair", "Pairer"]

HALF_FRAME_US = 17_000
"""Half a frame period at 30 frames a second, microseconds, rounded up."""

_CAPACITY = 4
"""Items of a stream that wait for a partner, at most."""

D = TypeVar("D")
C = TypeVar("C")


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

    Attributes
    ----------
    depth, color : the two streams: what waits for a partner, and how many found none
    """

    def __init__(self, tolerance_us: int = HALF_FRAME_US, capacity: int = _CAPACITY) -> None:
        if tolerance_us < 0:
            raise ValueError(f"tolerance_us must not be negative, got {tolerance_us}")
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.tolerance_us = tolerance_us
        self.capacity = capacity
        self.depth, self.color = _Stream(), _Stream()

    def add_depth(self, stamp_us: int, item: D) -> Pair[D, C] | None:
        """Take a depth item; give the pair that it completes, if any."""
        partner = self._add(self.depth, self.color, stamp_us, item)
        return partner and Pair(item, partner[1], stamp_us, partner[0])

    def add_color(self, stamp_us: int, item: C) -> Pair[D, C] | None:
        """Take a colour item; give the pair that it completes, if any."""
        partner = self._add(self.color, self.depth, stamp_us, item)
        return partner and Pair(partner[1], item, partner[0], stamp_us)

    def clear(self) -> None:
        """Drop what waits, as at a press: what comes next is newer."""
        for stream in (self.depth, self.color):
            stream.drop(len(stream.items))
            stream.last_us = None

    def _add(
        self, own: "_Stream", other: "_Stream", stamp_us: int, item: Any
    ) -> tuple[int, Any] | None:
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


@dataclass
class _Stream:
    """What waits of one stream, oldest first, with its stamps, and how many were dropped."""

    items: deque[tuple[int, Any]] = field(default_factory=deque)
    last_us: int | None = None
    dropped: int = 0

    def drop(self, count: int) -> None:
        """Drop the oldest `count`, if any."""
        for _ in range(count):
            self.items.popleft()
            self.dropped += 1
