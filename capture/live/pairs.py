"""Pairs of depth and colour as they come in, each with when it was exposed and how that is known.

Where one clock stamps both streams, stamps say what belongs together, and the skew is exact. Where
the clocks differ, or there are none, arrivals do, and a note says so.
"""

import threading
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field

from denseface.capture.live.clock import TRANSPORT_S, Exposure, StampKind, StreamClock
from denseface.capture.live.freshness import Freshness
from denseface.capture.live.ring import Slot
from denseface.capture.pairing import Pairer

__all__ = ["LivePair", "LivePairs", "PairLog"]

_SAME_CLOCK_S = 0.1
"""Depth and colour of one clock arrive so differently at most after their stamps, seconds: three
periods, since the transport of the two may differ."""
_KEPT = 4
"""Newest pairs that are kept for who looks a little later."""


@dataclass(frozen=True, slots=True)
class _Arrived:
    slot: Slot
    exposure: Exposure


@dataclass(frozen=True, slots=True)
class LivePair:
    """Depth and colour that belong together, in the ring's memory."""

    number: int
    """Of the pair, from 1."""
    depth: Slot
    color: Slot | None
    """None where the sensor has no colour camera."""
    depth_us: int
    color_us: int
    """Stamps on one clock, microseconds: the sensor's, or the monotonic one where it has none."""
    earliest_s: float
    """Neither image was exposed before, monotonic clock, seconds."""
    latest_s: float
    """Nor after."""
    exposure_known_by: str
    """``stamps`` or ``arrival``."""
    skew_known_by: str
    """``stamps`` or ``arrival``; empty without colour."""
    notes: tuple[str, ...] = ()

    def hold(self) -> None:
        """Keep the images from being written over; see `release`."""
        for slot in filter(None, (self.depth, self.color)):
            slot.hold()

    def release(self) -> None:
        """Hold the images no more."""
        for slot in filter(None, (self.depth, self.color)):
            slot.release()


class LivePairs:
    """Makes pairs of what arrives.

    Parameters
    ----------
    started_s : when each stream was started, by its kind (`depth`, `color`), monotonic clock;
        without `color`, each depth image is a pair of its own
    transport_s : longest time from exposure to arrival

    Attributes
    ----------
    clocks : of the streams
    count : of the pairs
    repeats : images that the driver gave twice
    last_new_s : when the last new image of each stream came, monotonic clock; at first, its start
    skew_us : of the last pair: how much later the depth was taken, microseconds
    """

    def __init__(
        self, started_s: Mapping[str, float], transport_s: float = TRANSPORT_S
    ) -> None:
        self.clocks = {kind: StreamClock(at, transport_s) for kind, at in started_s.items()}
        self._pairer: Pairer[_Arrived, _Arrived] = Pairer(
            dropped=lambda arrived: arrived.slot.release())
        self._freshness = {kind: Freshness() for kind in started_s}
        self.count = self.repeats = self.skew_us = 0
        self.last_new_s = dict(started_s)

    def add(self, kind: str, slot: Slot, stamp_us: int, arrival_s: float) -> LivePair | None:
        """Take an image, with the caller's hold on its slot; give the pair that it completes.

        The pair's slots are held for the caller. None also where the driver gave an image twice.
        """
        exposure = self.clocks[kind].add(stamp_us, arrival_s)
        self._freshness[kind].look(slot.memory)
        froze = self._freshness[kind].same and all(one.noisy for one in self._freshness.values())
        if exposure is None or froze:
            self.repeats += 1
            slot.release()
            return None
        self.last_new_s[kind] = arrival_s
        arrived = _Arrived(slot, exposure)
        if len(self.clocks) == 1:
            return self._pair(arrived, None)
        self._pairer.follow(self.clocks["depth"].period_s, self.clocks["color"].period_s)
        add = self._pairer.add_depth if kind == "depth" else self._pairer.add_color
        pair = add(round(self._common_s(exposure) * 1e6), arrived)
        return self._pair(pair.depth, pair.color) if pair else None

    def close(self) -> None:
        """Release what waits for a partner."""
        self._pairer.clear()

    @property
    def period_s(self) -> float:
        """Time from pair to pair, seconds."""
        return max(clock.period_s for clock in self.clocks.values())

    @property
    def one_clock(self) -> bool:
        """Whether one clock stamps both streams."""
        offsets = [clock.offset_s for clock in self.clocks.values()]
        known = [offset for offset in offsets if offset is not None]
        return len(known) == len(offsets) and max(known) - min(known) <= _SAME_CLOCK_S

    def _common_s(self, exposure: Exposure) -> float:
        """Give a time by which both streams' images can be compared, monotonic clock, seconds."""
        if exposure.stamp_s is None or not self.one_clock:
            return exposure.latest_s
        return exposure.stamp_s + min(clock.offset_s or 0.0 for clock in self.clocks.values())

    def _pair(self, depth: _Arrived, color: _Arrived | None) -> LivePair:
        self.count += 1
        by_stamps = depth.exposure.stamp_s is not None
        depth_s = depth.exposure.latest_s if depth.exposure.stamp_s is None else (
            depth.exposure.stamp_s)
        depth_us = round(depth_s * 1e6)
        if color is None:
            return LivePair(
                self.count, depth.slot, None, depth_us, depth_us, depth.exposure.earliest_s,
                depth.exposure.latest_s, _known_by(stamps=by_stamps), "", self._notes())
        a, b = depth.exposure, color.exposure
        exact = self.one_clock and a.stamp_s is not None and b.stamp_s is not None
        skew_s = (a.stamp_s - b.stamp_s if exact and a.stamp_s is not None
                  and b.stamp_s is not None else a.latest_s - b.latest_s)
        self.skew_us = round(skew_s * 1e6)
        return LivePair(
            self.count, depth.slot, color.slot, depth_us, depth_us - self.skew_us,
            min(a.earliest_s, b.earliest_s), max(a.latest_s, b.latest_s),
            _known_by(stamps=by_stamps and b.stamp_s is not None), _known_by(stamps=exact),
            self._notes())

    def _notes(self) -> tuple[str, ...]:
        """Say what is doubtful about the times."""
        useless = [f"the {kind} stream's time stamps {_USELESS[clock.kind]}"
                   for kind, clock in self.clocks.items() if clock.kind in _USELESS]
        if useless:
            return (f"{' and '.join(useless)}: times are known by arrival",)
        if len(self.clocks) == 2 and not self.one_clock:
            ahead_s = self._ahead_s()
            if ahead_s is not None:
                return (f"the color stream's clock is {abs(ahead_s) * 1e3:.0f} ms "
                        f"{'ahead of' if ahead_s > 0 else 'behind'} the depth stream's: paired by "
                        "arrival",)
        return ()

    def _ahead_s(self) -> float | None:
        depth_s, color_s = (self.clocks[kind].offset_s for kind in ("depth", "color"))
        return None if depth_s is None or color_s is None else depth_s - color_s


_USELESS = {StampKind.NONE: "do not advance", StampKind.FOREIGN: "do not run as time does"}


def _known_by(*, stamps: bool) -> str:
    return "stamps" if stamps else "arrival"


@dataclass
class PairLog:
    """The newest pairs, for any thread; what is given is held for who asked."""

    _pairs: deque[LivePair] = field(default_factory=deque)
    _changed: threading.Condition = field(default_factory=threading.Condition)
    _closed: bool = False

    def add(self, pair: LivePair) -> None:
        """Take a pair, with the caller's hold on it; the oldest gives way."""
        with self._changed:
            self._pairs.append(pair)
            old = self._pairs.popleft() if len(self._pairs) > _KEPT else None
            self._changed.notify_all()
        if old is not None:
            old.release()

    def newest(self) -> LivePair | None:
        """Give the newest pair."""
        with self._changed:
            return self._held(self._pairs[-1] if self._pairs else None)

    def first_after(self, after_s: float) -> LivePair | None:
        """Give the first pair that was surely exposed at a time or later, monotonic clock."""
        with self._changed:
            return self._held(next((p for p in self._pairs if p.earliest_s >= after_s), None))

    def wait(self, number: int, timeout_s: float) -> bool:
        """Wait for a pair after that of a number; False where none came."""
        with self._changed:
            return self._changed.wait_for(lambda: self._closed or (
                bool(self._pairs) and self._pairs[-1].number > number), timeout_s)

    def clear(self) -> None:
        """Forget all."""
        with self._changed:
            while self._pairs:
                self._pairs.popleft().release()
            self._changed.notify_all()

    def _held(self, pair: LivePair | None) -> LivePair | None:
        if pair is not None:
            pair.hold()
        return pair
