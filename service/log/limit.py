"""How many lines of one kind the log takes.

Whoever may send a message may cause lines: they must not fill a disk, nor hide what others caused.
"""

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from structlog import DropEvent
from structlog.typing import EventDict

from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["LogLimit"]

_INFO = (200.0, 20.0)
"""Lines of one kind at once, and a second in the long run: what goes as it should."""
_OTHERS = (20.0, 0.2)
"""The same of warnings and errors, which can be caused without anything being done."""
_MAX_KINDS = 1024


@dataclass
class _Bucket:
    """What one kind may still log."""

    lines: TokenBucket
    suppressed: int = 0

    def take(self, now: float) -> int | None:
        """Take the place of a line and give how many had none since the last; None without one."""
        if not self.lines.take(now):
            return None
        suppressed, self.suppressed = self.suppressed, 0
        return suppressed


class LogLimit:
    """A processor that drops events of which there were too many.

    Events are of one kind where they have the same text and the same `key`, the peer's; or the
    same `per`, a tuple of strings in place of these, which is not logged. The event that follows
    dropped ones says how many they were, as `suppressed`.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._buckets: BoundedDict[tuple[str, ...], _Bucket] = BoundedDict(_MAX_KINDS)
        self._lock = threading.RLock()

    def __call__(self, _: object, level: str, event: EventDict) -> EventDict:
        """Give the event; raises `DropEvent` where there were too many of its kind."""
        kind = event.pop("per", None) or (event["event"], str(event.get("key", "")))
        with self._lock:
            now = self._clock()
            one = self._buckets.get(kind)
            if one is None:
                burst, per_s = _INFO if level == "info" else _OTHERS
                one = self._buckets[kind] = _Bucket(TokenBucket(burst, per_s, now))
            suppressed = one.take(now)
            if suppressed is None:
                one.suppressed += 1
                raise DropEvent
        if suppressed:
            event["suppressed"] = suppressed
        return event

    def suppressed(self) -> Iterator[tuple[str, int]]:
        """Give kinds that were dropped and may log again, and how many lines, once."""
        with self._lock:
            now = self._clock()
            found = [(" ".join(filter(None, kind)), suppressed)
                     for kind, one in self._buckets.items()
                     if one.suppressed and (suppressed := one.take(now))]
        yield from found
