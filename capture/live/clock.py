"""When a frame was exposed, on this machine's monotonic clock.

A stamp tells when a frame was taken, by a clock of the sensor's whose zero means nothing; its
arrival is known by our clock, but is later by the transport and by whatever kept this machine busy.
Arrival minus stamp is the offset of the clocks plus those delays; its running minimum is free of
the machine's, and less the transport it is the offset: the fastest of many samples is the truest,
as in NTP's clock filter (RFC 5905, section 10).

The transport is not known. There is a longest one; and as a stream's first frame was not exposed
before the stream was started, a sensor that starts fast limits it better. So an exposure is an
interval, and who must not have an old frame asks for its beginning.
"""

import math
from collections import deque
from dataclasses import dataclass
from enum import Enum
from itertools import pairwise
from statistics import median

__all__ = ["TRANSPORT_S", "Exposure", "StampKind", "StreamClock"]

TRANSPORT_S = 0.070
"""Longest time from a frame's exposure to its arrival, seconds: two periods at 30 frames a second,
twice what ROS's openni2_camera assumes of these sensors (33 ms)."""

_DEFAULT_PERIOD_S = 1 / 30
"""Before there is a measurement, seconds."""
_SETTLED = 8
"""Frames after which the kind of stamps and their offset are known."""
_SAMPLES = 16
"""Frames from which the period, the kind of stamps and at the start the transport are measured."""
_WINDOW_S = 10.0
"""The minimum is that of the last one or two windows, seconds: it follows a clock that drifts (by
10 ms at 500 parts in a million)."""
_JUMP_S = 0.25
"""A frame that arrives so much sooner after its stamp than the fastest one, or `_SAMPLES` frames
that arrive so much later: the clock jumped, seconds. A smaller jump ahead is but a new minimum."""
_SHORT_STEP = 0.3
"""A step from stamp to stamp below this part of the period: the clock jumped back."""
_RATES = 0.7, 1.4
"""How fast a clock may run against ours over `_SAMPLES` frames: arrivals jitter."""


class StampKind(Enum):
    """What a stream's stamps are good for."""

    UNKNOWN = "unknown"
    """Too few frames yet, also after a jump."""
    GOOD = "good"
    MILLISECONDS = "milliseconds"
    """Good, but not in OpenNI2's microseconds."""
    NONE = "none"
    """They do not advance."""
    FOREIGN = "foreign"
    """They advance at another rate than time."""


_UNITS_S = {StampKind.GOOD: 1e-6, StampKind.MILLISECONDS: 1e-3}
"""Units of the useful kinds of stamps, seconds."""


@dataclass(frozen=True, slots=True)
class Exposure:
    """When a frame was exposed: somewhere from `earliest_s` to `latest_s`, monotonic clock."""

    earliest_s: float
    latest_s: float
    """Also when it would have arrived without a delay of this machine."""
    stamp_s: float | None
    """The sensor's stamp, seconds; None where it is of no use and the arrival alone is known."""


class StreamClock:
    """Follows the stamps of one stream.

    Parameters
    ----------
    started_s : just before the stream was started, monotonic clock: no frame is older
    transport_s : longest time from exposure to arrival

    Attributes
    ----------
    kind : what the stamps are good for
    period_s : measured time from frame to frame, where none is lost
    transport_s : longest time from exposure to arrival, as far as it is known
    offset_s : least arrival minus stamp of late; None while stamps are of no use
    frames : how many came, a repeat of the one before left out
    jumps : how often the sensor's clock jumped or started over
    missed : frames that never came, by gaps in the stamps or arrivals
    """

    def __init__(self, started_s: float, transport_s: float = TRANSPORT_S) -> None:
        if not 0 <= transport_s < 10:
            raise ValueError(f"transport_s must be from 0 to 10, got {transport_s}")
        self.period_s = _DEFAULT_PERIOD_S
        self.transport_s = transport_s
        self.frames = self.jumps = self.missed = 0
        self._started_s = started_s
        self._first: int | None = None
        """The very first stamp, as long as the transport is measured."""
        self._begin_segment()

    def _begin_segment(self) -> None:
        """Forget what was measured: from here on the sensor's clock is another one."""
        self.kind = StampKind.UNKNOWN
        self.offset_s: float | None = None
        self._samples: deque[tuple[int, float]] = deque(maxlen=_SAMPLES)
        self._minima = [math.inf, math.inf]
        """Of arrival minus stamp, seconds, in the present window and the one before."""
        self._window_ends = -math.inf

    def add(self, stamp_us: int, arrival_s: float) -> Exposure | None:
        """Take a frame; None where it is the one before once more: the same stamp.

        Parameters
        ----------
        stamp_us : as the driver gave it
        arrival_s : when it was read, monotonic clock; it may have waited since the last one was
        """
        last = self._samples[-1] if self._samples else None
        if last is None:
            self._first = stamp_us
            self.transport_s = min(self.transport_s, max(arrival_s - self._started_s, 0.0))
        elif self.offset_s is not None:
            if stamp_us == last[0]:
                return None
            if self._jumped(stamp_us, last[0], arrival_s):
                self.jumps += 1
                self._first = None
                self._begin_segment()
        self._count_missed(stamp_us, arrival_s)
        self.frames += 1
        self._samples.append((stamp_us, arrival_s))
        self._classify()
        self._measure_period()
        if self.offset_s is None:
            # It was delivered after the one before was read, and before it was read itself.
            since = last[1] if last else self._started_s
            return Exposure(max(since - self.transport_s, self._started_s), arrival_s, None)
        stamp_s = stamp_us * self._unit_s
        delivered_s = min(stamp_s + self.offset_s, arrival_s)
        return Exposure(delivered_s - self.transport_s, delivered_s, stamp_s)

    @property
    def _unit_s(self) -> float:
        return _UNITS_S.get(self.kind, 1e-6)

    def _jumped(self, stamp_us: int, last_us: int, arrival_s: float) -> bool:
        """Say whether the clock jumped or is no clock; a busy machine explains late arrivals only.

        One frame may come late by any time, `_SAMPLES` of them in a row by no more than `_JUMP_S`.
        """
        late_s = [arrival - stamp * self._unit_s - (self.offset_s or 0.0)
                  for stamp, arrival in (*self._samples, (stamp_us, arrival_s))]
        return ((stamp_us - last_us) * self._unit_s < _SHORT_STEP * self.period_s
                or late_s[-1] < -_JUMP_S or (len(late_s) > _SAMPLES and min(late_s) > _JUMP_S))

    def _count_missed(self, stamp_us: int, arrival_s: float) -> None:
        if len(self._samples) < _SETTLED:
            return
        stamp, arrival = self._samples[-1]
        step_s = (arrival_s - arrival if self.offset_s is None else
                  (stamp_us - stamp) * self._unit_s)
        self.missed += max(round(step_s / self.period_s) - 1, 0)

    def _classify(self) -> None:
        """Say what the stamps are good for, and follow the offset where they are."""
        if len(self._samples) < _SETTLED:
            return
        fresh = [self._samples[-1]]
        if self.kind not in _UNITS_S:
            self.kind = self._kind()
            fresh = [*self._samples]
        if self.kind not in _UNITS_S:
            return
        for stamp, arrival in fresh:
            if arrival >= self._window_ends:
                self._minima = [math.inf, self._minima[0]]
                self._window_ends = arrival + _WINDOW_S
            self._minima[0] = min(self._minima[0], arrival - stamp * self._unit_s)
        self.offset_s = min(self._minima)
        self._limit_transport()

    def _kind(self) -> StampKind:
        steps = [b[0] - a[0] for a, b in pairwise(self._samples)]
        if not any(steps):
            return StampKind.NONE
        passed_s = self._samples[-1][1] - self._samples[0][1]
        for kind, unit_s in _UNITS_S.items():
            if min(steps) > 0 and _RATES[0] * passed_s < sum(steps) * unit_s < _RATES[1] * passed_s:
                return kind
        return StampKind.FOREIGN

    def _limit_transport(self) -> None:
        """Use that the first frame is no older than the start, while the clocks have not drifted.

        By the first frame's stamp it was exposed no earlier than at `_started_s`, and the fastest
        frame says when it would have arrived at the latest.
        """
        if self._first is None or self.offset_s is None:
            return
        delivered_s = self._first * self._unit_s + self.offset_s
        self.transport_s = min(self.transport_s, max(delivered_s - self._started_s, 0.0))
        if len(self._samples) == _SAMPLES:
            self._first = None

    def _measure_period(self) -> None:
        """Measure the period: the shortest step of stamps, as frames are lost; arrivals jitter."""
        by_stamps = self.offset_s is not None
        steps_s = [(b[0] - a[0]) * self._unit_s if by_stamps else b[1] - a[1]
                   for a, b in pairwise(self._samples)]
        if len(steps_s) >= 3 and (period_s := (min if by_stamps else median)(steps_s)) > 0:
            self.period_s = period_s
