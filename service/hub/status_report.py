"""What the hub says of itself: at each heartbeat, and at once where a press could have another end.

That is where a sensor's state changes, a worker comes or goes, or presses begin or cease to be
refused whatever the sensor.
"""

import math
from collections.abc import Iterator
from itertools import islice

from pydantic import ValidationError

from denseface.service.errors import LocalProtocolError, StoreError, first_error
from denseface.service.hub import sensors
from denseface.service.hub._common import Common
from denseface.service.hub.jobs import Jobs
from denseface.service.hub.presses import Presses
from denseface.service.monitoring import Figures, Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Publish
from denseface.service.protocol.states import CaptureState
from denseface.service.protocol.status import MAX_COMPILING, MAX_SENSOR_STATES
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.version import VERSION

"""Of this package, as the status says it."""
_APART_S = 0.1
"""Shortest time between two statuses, seconds: changes that come closer are told together."""


class StatusReport:
    """Makes the status and says when it is to be published."""

    def __init__(
        self, common: Common, presses: Presses, jobs: Jobs, figures: Figures,
        rejections: Rejections,
    ) -> None:
        self._store, _, _, self._peers, self._settings = common
        self._presses = presses
        self._jobs = jobs
        self._figures = figures
        self._rejections = rejections
        self._heartbeat_due = 0.0
        self._published = -math.inf
        self._changed = False
        self._obstacle = ""
        self._subscribers = 0

    def note_change(self) -> None:
        """Say that a sensor or worker came, went or changed."""
        self._changed = True

    def note_subscribers(self, number: int) -> None:
        """Say how many subscribe to it: a new one is told at once."""
        self._changed |= number > self._subscribers
        self._subscribers = number

    def due(self) -> float:
        """Return when a change is to be told, seconds; infinite where there is none."""
        return self._published + _APART_S if self._changed else math.inf

    def tell_changes(self, now: float) -> Iterator[Output]:
        """Publish it where that is due."""
        if now >= self.due():
            yield self._publish(now)

    def tick(self, now: float) -> Iterator[Output]:
        """Publish it at each heartbeat, or where presses are refused now or no longer."""
        self._changed |= self._why_refused() != self._obstacle
        if now >= self._heartbeat_due:  # whatever was told between: a snapshot is taken of these
            self._heartbeat_due = now + self._settings.heartbeat_s
            yield self._publish(now)
        else:
            yield from self.tell_changes(now)

    def make(self, request: int = 0) -> messages.Status:
        """Give the status; LocalProtocolError where a name or count is none that it may have."""
        try:
            return self._make(request)
        except ValidationError as error:
            field, reason = first_error(error)
            raise LocalProtocolError(f"status: {field}: {reason}") from error

    def _publish(self, now: float) -> Output:
        # First, so that a status that cannot be made is not tried at each message.
        self._changed, self._published = False, now
        status = self.make()
        self._obstacle = status.obstacle
        return Publish(Topic.STATUS, Packet(status))

    def _why_refused(self) -> str:
        obstacle = self._presses.obstacle(self._jobs.queued)
        return obstacle[0] if obstacle else ""

    def _make(self, request: int) -> messages.Status:
        counts, counters = self._store.counts(), self._figures.counters
        known = sensors.best_first(self._peers.sensors.values())
        return messages.Status(
            request=request, epoch=self._store.epoch, sequence=self._store.last_sequence(),
            hub_version=VERSION,
            sensors=tuple(one.name for one in known if one.can_be_asked),
            sensor_states=tuple(one.status() for one in known[:MAX_SENSOR_STATES]),
            workers=tuple(worker.name for worker in self._peers.workers.values()
                          if not worker.away),
            pressed=len(self._presses), queued=self._jobs.queued, working=self._jobs.working,
            done=counts.get(CaptureState.DONE, 0), failed=counts.get(CaptureState.FAILED, 0),
            dead=counts.get(CaptureState.DEAD, 0),
            refused=self._rejections.counts(),
            presses_refused=counters.by_label("press_refused"),
            since_start={name: count for name, label, count in counters.items() if not label},
            latencies={stage: messages.Latency(
                count=one.count, median_s=one.quantile_s(0.5), p99_s=one.quantile_s(0.99))
                for stage, one in self._figures.latencies.stages().items()},
            restarts=self._figures.restarts,
            free_bytes=self._free_bytes(), kept_bytes=self._figures.kept_bytes,
            log_lines_lost=self._figures.log_lines_lost,
            obstacle=self._why_refused(), retention_s=self._settings.retention,
            heartbeat_s=self._settings.heartbeat_s,
            compiling=tuple(one.compiling for one in islice(
                self._peers.starting.values(), MAX_COMPILING)))

    def _free_bytes(self) -> int | None:
        try:
            return self._store.free_bytes()
        except StoreError:
            return None
