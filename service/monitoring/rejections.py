"""Refused connections and messages: counted by reason, logged with who it was, within a limit."""

import time
from collections.abc import Callable
from dataclasses import dataclass

import structlog

from denseface.service.monitoring.figures import Counters

__all__ = ["Rejections"]

_BURST = 5.0
"""Lines that one reason may log at once."""
_PER_S = 0.2
"""Lines that one reason may log per second in the long run: garbage must not fill a disk."""


@dataclass
class _TokenBucket:
    """Limits the log lines of one reason."""

    lines: float = _BURST
    since: float = 0.0
    suppressed: int = 0


class Rejections:
    """Counts under the name `refused`, with the reason as label."""

    def __init__(self, counters: Counters, clock: Callable[[], float] = time.monotonic) -> None:
        self._counters = counters
        self._clock = clock
        self._buckets: dict[str, _TokenBucket] = {}
        self._log = structlog.get_logger("hub")

    def counts(self) -> dict[str, int]:
        """Give the number of rejections by reason."""
        return self._counters.by_label("refused")

    def note(self, reason: str, **who: object) -> None:
        """Count a rejection and log it, unless its reason has logged too much.

        `reason` is one of a fixed set, `who` names the key, the address and what else is known.
        """
        self._counters.add("refused", reason)
        now = self._clock()
        one = self._buckets.setdefault(reason, _TokenBucket(since=now))
        one.lines = min(_BURST, one.lines + (now - one.since) * _PER_S)
        one.since = now
        if one.lines < 1:
            one.suppressed += 1
            return
        one.lines -= 1
        more = {"suppressed": one.suppressed} if one.suppressed else {}
        one.suppressed = 0
        self._log.warning("refused", reason=reason, **who, **more)
