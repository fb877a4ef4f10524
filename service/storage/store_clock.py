"""How long something has been kept, whatever is done to the wall clock.

A kiosk's clock is set by hand, by a time server after a start without one, or wrongly. An age by
that clock alone would let one jump forward remove everything that is kept. So the store counts the
seconds of its own life: exactly, by a clock that is never set, as long as the machine runs; by the
wall clock for the time that it was switched off, which nothing else can tell.
"""

import json
import math
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

__all__ = ["Clock", "StoreClock", "SystemClock", "stamp"]

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
_GRACE_S = 3600.0
"""Longest time between a start that found the wall clock far ahead and the first removal."""


class Clock(Protocol):
    """The two clocks of a machine."""

    def wall(self) -> datetime:
        """Give the time of day, UTC; may be set forward and back."""

    def boot(self) -> tuple[str, float]:
        """Give a name of this start of the machine and the seconds since then, asleep or not."""


class SystemClock:
    """The clocks of this machine."""

    def __init__(self) -> None:
        self._boot_id = _BOOT_ID.read_text().strip()

    def wall(self) -> datetime:
        """Give the time of day, UTC."""
        return datetime.now(UTC)

    def boot(self) -> tuple[str, float]:
        """Give the kernel's name of this start and the seconds since then."""
        return self._boot_id, time.clock_gettime(time.CLOCK_BOOTTIME)


def stamp(moment: datetime) -> str:
    """Write a time so that later ones sort later."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True)
class _Mark:
    """The account at one moment, and what both clocks said then."""

    seconds: float
    wall: str
    boot: str
    at: float


class StoreClock:
    """Seconds of a store's life.

    Parameters
    ----------
    saved : the last `save` of this store, None for a new one

    Raises
    ------
    ValueError
        Where `saved` is not what `save` gives.
    """

    def __init__(self, clock: Clock, saved: str | None) -> None:
        self._clock = clock
        boot, at = clock.boot()
        wall = clock.wall()
        mark = _read(saved) if saved else _Mark(0.0, stamp(wall), boot, at)
        self.gap_s = 0.0
        """Time switched off, as the wall clock tells it: the part that may be wrong, seconds."""
        passed = at - mark.at
        if boot != mark.boot or passed < 0:
            passed = max(0.0, (wall - datetime.fromisoformat(mark.wall)).total_seconds())
            self.gap_s = passed
        self._start = _Mark(mark.seconds + passed, stamp(wall), boot, at)

    @staticmethod
    def seconds_of(saved: str) -> float:
        """Give the age of the store when `save` gave this; ValueError as above."""
        return _read(saved).seconds

    def now(self) -> float:
        """Give the age of the store, seconds."""
        return self._start.seconds + self._running_s()

    def wall(self) -> datetime:
        """Give the time of day, UTC."""
        return self._clock.wall()

    def save(self) -> str:
        """Give what the next `StoreClock` of this store needs to go on."""
        boot, at = self._clock.boot()
        return json.dumps({"seconds": self.now(), "wall": stamp(self._clock.wall()),
                           "boot": boot, "at": at})

    def settled(self, retention_s: float) -> bool:
        """Say whether ages may be acted upon.

        Where much of them is a gap that only the wall clock tells of, someone shall have an hour
        to see and mend a wrong clock.
        """
        grace = min(_GRACE_S, retention_s / 2)
        return self.gap_s <= grace or self._running_s() >= grace

    def _running_s(self) -> float:
        return max(0.0, self._clock.boot()[1] - self._start.at)


def _read(saved: str) -> _Mark:
    try:
        mark = _Mark(**json.loads(saved))
        finite = math.isfinite(mark.seconds) and math.isfinite(mark.at)
        zone = datetime.fromisoformat(mark.wall).tzinfo
    except (TypeError, ValueError) as error:
        raise ValueError(f"clock mark {saved[:200]!r}: {error}") from error
    if not finite or zone is None:
        raise ValueError(f"clock mark {saved[:200]!r}: expected finite seconds and a zone")
    return mark
