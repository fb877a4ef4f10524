"""Pairing of depth and colour by when they were exposed.

The two cameras of a sensor are not exposed together (a Kinect v1's stamps lie 12 ms apart), frames
of either may be lost, their rates may differ, and the order of arrival means nothing. Two frames
belong together when they are nearest to each other and differ by no more than a tolerance of about
half a frame period of the slower stream.
"""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Generic, TypeVar

__all__ = ["HALF_FRAME_US", "Pair", "Pairer"]

HALF_FRAME_US = 17_000
"""Half a frame period at 30 frames a second, microseconds, rounded up."""

_CAPACITY = 4
"""Items of a stream that wait for a partner, at most."""
_MARGIN = 1.05
"""On half a period: streams of one rate that are exactly half a period apart pair all the same."""
_LIKE = 1.5
"""Two streams whose periods differ by less than this factor are of one rate."""

D = TypeVar("D")
C = TypeVar("C")


@dataclass(frozen=True)
class Pair(Generic[D, C]):
    """A depth and a colour item with their stamps, one clock, microseconds."""

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
    dropped : called with each item that is dropped

    Attributes
    ----------
    depth, color : the two streams: what waits for a partner, and how many found none
    """

    def __init__(
        self, tolerance_us: int = HALF_FRAME_US, capacity: int = _CAPACITY,
        dropped: Callable[[D | C], object] = lambda _: None,
    ) -> None:
        if tolerance_us < 0:
            raise ValueError(f"tolerance_us must not be negative, got {tolerance_us}")
        if capacity < 1:
            raise ValueError(f"capacity must be at least 1, got {capacity}")
        self.tolerance_us = self._settled_us = tolerance_us
        self.capacity = capacity
        self.depth, self.color = _Stream(dropped), _Stream(dropped)
        self._slow: _Stream | None = None

    def follow(self, depth_period_s: float, color_period_s: float) -> None:
        """Set the tolerance by the periods measured, seconds.

        Where one stream is faster by far, an item of the slower one waits until its nearest
        partner is certain: closer than half the faster one's period, or passed.
        """
        fast_s, slow_s = sorted((depth_period_s, color_period_s))
        if not 0 < fast_s <= slow_s:
            raise ValueError(f"periods must be positive, got {depth_period_s}, {color_period_s}")
        self.tolerance_us = round(slow_s * _MARGIN / 2 * 1e6)
        self._settled_us, self._slow = self.tolerance_us, None
        if slow_s >= _LIKE * fast_s:
            self._settled_us = round(fast_s / 2 * 1e6)
            self._slow = self.depth if depth_period_s > color_period_s else self.color

    def add_depth(self, stamp_us: int, item: D) -> Pair[D, C] | None:
        """Take a depth item; give the pair that it completes, if any."""
        found = self._add(self.depth, self.color, stamp_us, item)
        return found and Pair(found[0][1], found[1][1], found[0][0], found[1][0])

    def add_color(self, stamp_us: int, item: C) -> Pair[D, C] | None:
        """Take a colour item; give the pair that it completes, if any."""
        found = self._add(self.color, self.depth, stamp_us, item)
        return found and Pair(found[1][1], found[0][1], found[1][0], found[0][0])

    def clear(self) -> None:
        """Drop what waits, as at a press: what comes next is newer."""
        for stream in (self.depth, self.color):
            stream.drop(len(stream.items))
            stream.last_us = None

    def _add(
        self, own: "_Stream", other: "_Stream", stamp_us: int, item: Any
    ) -> tuple["_Item", "_Item"] | None:
        """Let the item wait, and take what it makes certain: one of each stream."""
        if own.last_us is not None and stamp_us <= own.last_us:
            self.clear()  # the sensor's clock started over
        own.last_us = stamp_us
        own.items.append((stamp_us, item))
        at = other.nearest(stamp_us)
        mine = len(own.items) - 1
        if own is not self._slow and other is self._slow and at is not None:
            # A faster stream's item may make certain which of those before it was the nearest.
            mine = own.nearest(other.items[at][0]) or 0
        if at is None or not self._certain(own.items[mine][0], other, at, stamp_us):
            own.drop(len(own.items) - self.capacity)
            return None
        other.drop(at)
        own.drop(mine)
        return own.items.popleft(), other.items.popleft()

    def _certain(self, own_us: int, other: "_Stream", at: int, newest_us: int) -> bool:
        """Say whether two belong together, and no later item of the faster stream is nearer."""
        other_us = other.items[at][0]
        apart_us = abs(own_us - other_us)
        if apart_us <= self._settled_us:
            return True
        passed = (newest_us >= other_us if other is self._slow else
                  other.items[-1][0] >= newest_us)
        return apart_us <= self.tolerance_us and passed


_Item = tuple[int, Any]
"""Stamp and item."""


@dataclass
class _Stream:
    """What waits of one stream, oldest first, with its stamps, and how many were dropped."""

    on_drop: Callable[[Any], object]
    items: deque[_Item] = field(default_factory=deque)
    last_us: int | None = None
    dropped: int = 0

    def nearest(self, stamp_us: int) -> int | None:
        """Give the place of the item nearest to a stamp; None where none waits."""
        return min(range(len(self.items)), default=None,
                   key=lambda at: abs(self.items[at][0] - stamp_us))

    def drop(self, count: int) -> None:
        """Drop the oldest `count`, if any."""
        for _ in range(count):
            self.on_drop(self.items.popleft()[1])
            self.dropped += 1
