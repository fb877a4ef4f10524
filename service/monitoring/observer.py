"""What the hub's process measures of itself, and the snapshots that other threads read."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field

import structlog

from denseface.service.log.output import process_log
from denseface.service.monitoring.figures import Figures, Histogram
from denseface.service.monitoring.message_watch import MessageWatch
from denseface.service.protocol.messages import Status
from denseface.service.protocol.outgoing import Output, Publish
from denseface.service.runtime.background import Background
from denseface.service.runtime.closing import Closing

__all__ = ["Observer", "Snapshot"]

_MEASURE_S = 60.0
"""Interval between measurements of the data folder, seconds."""


@dataclass(frozen=True)
class Snapshot:
    """The hub at its last heartbeat; immutable."""

    taken: float
    """Seconds of `time.monotonic`."""
    status: Status
    counts: tuple[tuple[str, str, int], ...]
    """Name, label, number."""
    stages: dict[str, Histogram]
    subscriptions: dict[str, int] = field(default_factory=dict)
    """By topic."""
    unreachable: tuple[str, ...] = ()
    """Why nobody can connect at an address."""


class Observer(Closing):
    """Records what the hub's loop tells it; gives snapshots.

    Parameters
    ----------
    measure : gives the size of what is kept, bytes; called in a thread; OSError where it cannot
    """

    def __init__(self, measure: Callable[[], int]) -> None:
        self.figures = Figures()
        self._snapshot: Snapshot | None = None
        self.watch = MessageWatch(self.figures)
        self._measure = measure
        self._measurement = Background[int]("usage")
        self._next_measurement = 0.0

    def close(self) -> None:
        """Wait for the measurement that is under way, if any."""
        self._measurement.close()

    def latest(self) -> Snapshot | None:
        """Give the last snapshot, None before there is one; for any thread."""
        return self._snapshot

    def record_tick(
        self, now: float, outputs: Sequence[Output], subscriptions: Mapping[str, int],
        unreachable: Sequence[str] = (),
    ) -> None:
        """Take a snapshot at each status that a tick publishes."""
        self._measure_folder(now)
        self.figures.log_lines_lost = process_log.lost
        for output in outputs:
            message = output.packet.message
            if isinstance(output, Publish) and isinstance(message, Status):
                self._snapshot = Snapshot(
                    now, message, tuple(self.figures.counters.items()),
                    self.figures.latencies.stages(), dict(subscriptions), tuple(unreachable))

    def _measure_folder(self, now: float) -> None:
        if self._measurement.done():
            try:
                self.figures.kept_bytes = self._measurement.result()
            except OSError as error:
                structlog.get_logger("hub").warning(
                    "what is kept cannot be measured", reason=str(error))
        elif not self._measurement and now >= self._next_measurement:
            self._next_measurement = now + _MEASURE_S
            self._measurement.start(self._measure)
