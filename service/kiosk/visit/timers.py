"""Timers of a visit: each carries the visit's number, so that none outlives its visit."""

from enum import StrEnum
from typing import NamedTuple

__all__ = ["Timer", "TimerDue", "Timers"]


class Timer(StrEnum):
    """What may become due; at most one of each runs."""

    IDLE = "idle"
    """Nobody touched anything for long."""
    COUNT = "count"
    """The next number of the countdown."""
    ANSWER = "answer"
    """The picture should be there."""
    SHOWN = "shown"
    """The screen was there long enough to be read, and goes on by itself."""


class TimerDue(NamedTuple):
    """A timer that ran out."""

    visit: int
    timer: Timer
    at_s: float


class Timers:
    """Those that run."""

    def __init__(self) -> None:
        self._running: dict[Timer, TimerDue] = {}

    def start(self, visit: int, timer: Timer, at_s: float) -> None:
        """Let one run out then; one that ran already begins anew."""
        self._running[timer] = TimerDue(visit, timer, at_s)

    def stop_all(self) -> None:
        """Let none run out."""
        self._running.clear()

    def at_s(self, timer: Timer) -> float | None:
        """Say when one is due."""
        found = self._running.get(timer)
        return found.at_s if found is not None else None

    @property
    def next_s(self) -> float | None:
        """When the next is due."""
        return min((one.at_s for one in self._running.values()), default=None)

    def pop(self, now_s: float) -> TimerDue | None:
        """Take out the one that is longest due."""
        due = min(self._running.values(), key=lambda one: one.at_s, default=None)
        if due is None or due.at_s > now_s:
            return None
        return self._running.pop(due.timer)
