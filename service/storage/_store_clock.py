"""Ages that survive changes of the wall clock.

A kiosk's clock is set by hand, by a time server after a start without one, or wrongly. If ages
were read from it, one jump forward would remove all captures. So the store counts the seconds
since it was created: by a clock that is never set while the machine runs, by the wall clock for
the time that it was switched off.
"""

import json
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Protocol

from pydantic import AwareDatetime, BaseModel, ConfigDict, FiniteFloat, ValidationError

from denseface.service.errors import first_error

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


class _State(BaseModel):
    """The age of the store at one moment, and what both clocks said then."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    seconds: FiniteFloat
    """Age of the store."""
    wall: AwareDatetime
    boot: str
    at: FiniteFloat
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
        boot, self._opened_at = clock.boot()
        self._opened_s = 0.0
        self.gap_s = 0.0
        """Time switched off by the wall clock, seconds: the part that may be wrong."""
        if saved:
            state = _parse(saved)
            passed = self._opened_at - state.at
            if boot != state.boot or passed < 0:
                passed = self.gap_s = max(0.0, (clock.wall() - state.wall).total_seconds())
            self._opened_s = state.seconds + passed

    @staticmethod
    def age_of(saved: str) -> float:
        """Give the age of the store at a `save`, seconds; ValueError as above."""
        return _parse(saved).seconds

    def now(self) -> float:
        """Give the age of the store, seconds."""
        return self._opened_s + self._running_s()

    def timestamp(self) -> str:
        """Give the time of day as `format_timestamp` does."""
        return format_timestamp(self._clock.wall())

    def save(self) -> str:
        """Give the state from which the next `StoreClock` of this store continues."""
        boot, at = self._clock.boot()
        return json.dumps(
            {"seconds": self.now(), "wall": self.timestamp(), "boot": boot, "at": at})

    def trusted(self, retention_s: float) -> bool:
        """Whether captures may be removed by their age.

        A long time switched off may be a wrong wall clock: removals then wait for up to an hour
        after the start, so that someone may correct it.
        """
        grace = min(_GRACE_S, retention_s / 2)
        return self.gap_s <= grace or self._running_s() >= grace

    def _running_s(self) -> float:
        return max(0.0, self._clock.boot()[1] - self._opened_at)


def _parse(saved: str) -> _State:
    try:
        return _State.model_validate_json(saved)
    except ValidationError as error:
        reason = " ".join(first_error(error))
        raise ValueError(f"saved clock {saved[:200]!r}: {reason}") from error
