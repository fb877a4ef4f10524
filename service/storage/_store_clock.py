"""Ages that survive changes of the wall clock.

A kiosk's clock is set by hand, by a time server after a start without one, or wrongly. If ages
were read from it, one jump forward would remove all captures. So the store counts the seconds
since it was created: by a clock that is never set while the machine runs, by the wall clock for
the time that it was switched off.
"""

import json
import math
import time
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

__all__ = ["Clock", "StoreClock", "SystemClock", "format_timestamp"]

_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")
"""Names this start of the machine; see proc_sys_kernel(5)."""
_GRACE_S = 3600.0
"""Longest delay of removals after a start that found the wall clock far ahead, seconds."""


class Clock(Protocol):
    """A machine's wall clock and its time since boot."""

    def wall(self) -> datetime:
        """Give the time of day, UTC; it may jump."""

    def boot(self) -> tuple[str, float]:
        """Give a name of this boot and the seconds since then, suspended or not."""


class SystemClock:
    """The clocks of this machine."""

    def __init__(self) -> None:
        self._boot_id = _BOOT_ID.read_text().strip()

    def wall(self) -> datetime:
        """Give the time of day, UTC."""
        return datetime.now(UTC)

    def boot(self) -> tuple[str, float]:
        """Give the kernel's id of this boot and the seconds since then."""
        return self._boot_id, time.clock_gettime(time.CLOCK_BOOTTIME)


def format_timestamp(moment: datetime) -> str:
    """Format a time, so that text sorts as time does."""
    return moment.astimezone(UTC).isoformat(timespec="milliseconds")


@dataclass(frozen=True)
class _State:
    """The age of the store at one moment, and what both clocks said then."""

    seconds: float
    """Age of the store."""
    wall: str
    boot: str
    at: float
    """Since that boot, seconds."""


class StoreClock:
    """The age of a store.

    Parameters
    ----------
    saved : what `save` gave last, None for a new store

    Raises
    ------
    ValueError
        Where `saved` is malformed.
    """

    def __init__(self, clock: Clock, saved: str | None) -> None:
        self._clock = clock
        boot, at = clock.boot()
        wall = clock.wall()
        state = _parse(saved) if saved else _State(0.0, format_timestamp(wall), boot, at)
        self.gap_s = 0.0
        """Time switched off by the wall clock, seconds: the part that may be wrong."""
        passed = at - state.at
        if boot != state.boot or passed < 0:
            passed = max(0.0, (wall - datetime.fromisoformat(state.wall)).total_seconds())
            self.gap_s = passed
        self._start = _State(state.seconds + passed, format_timestamp(wall), boot, at)

    @staticmethod
    def age_of(saved: str) -> float:
        """Give the age of the store at a `save`, seconds; ValueError as above."""
        return _parse(saved).seconds

    def now(self) -> float:
        """Give the age of the store, seconds."""
        return self._start.seconds + self._running_s()

    def wall(self) -> datetime:
        """Give the time of day, UTC."""
        return self._clock.wall()

    def save(self) -> str:
        """Give the state from which the next `StoreClock` of this store continues."""
        boot, at = self._clock.boot()
        return json.dumps({"seconds": self.now(), "wall": format_timestamp(self._clock.wall()),
                           "boot": boot, "at": at})

    def trusted(self, retention_s: float) -> bool:
        """Whether captures may be removed by their age.

        A long time switched off may be a wrong wall clock: removals then wait for up to an hour
        after the start, so that someone may correct it.
        """
        grace = min(_GRACE_S, retention_s / 2)
        return self.gap_s <= grace or self._running_s() >= grace

    def _running_s(self) -> float:
        return max(0.0, self._clock.boot()[1] - self._start.at)


def _parse(saved: str) -> _State:
    try:
        state = _State(**json.loads(saved))
        finite = math.isfinite(state.seconds) and math.isfinite(state.at)
        zone = datetime.fromisoformat(state.wall).tzinfo
    except (TypeError, ValueError) as error:
        raise ValueError(f"saved clock {saved[:200]!r}: {error}") from error
    if not finite or zone is None:
        raise ValueError(f"saved clock {saved[:200]!r}: expected finite seconds and a zone")
    return state
