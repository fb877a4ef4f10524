"""Retention, dead letters, purges."""

from collections.abc import Iterator, Sequence

import structlog

from denseface.service.errors import StoreError
from denseface.service.hub._common import Common
from denseface.service.hub.jobs import Jobs
from denseface.service.hub.outcomes import Outcomes
from denseface.service.hub.presses import Presses
from denseface.service.monitoring import Counters
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, send
from denseface.service.protocol.states import CaptureEvent, CaptureState

_BATCH = 20
"""Captures removed in one go: more would stall the event loop."""
_PAGE = 50
"""Dead letters in one answer, as `DeadLetters.letters` allows."""
_SWEEP_S = 600.0
"""Longest time between two sweeps for what is too old, seconds."""

_DeadLetterRequest = messages.RetryDead | messages.DropDead
_Request = messages.ListDead | _DeadLetterRequest | messages.Purge


class Maintenance:
    """Removes what is too old, and does what an operator asks for."""

    def __init__(
        self, common: Common, presses: Presses, jobs: Jobs, outcomes: Outcomes, counters: Counters
    ) -> None:
        self._store, self._captures = common.store, common.captures
        self._retention_s = common.settings.retention
        self._sweep_s = min(_SWEEP_S, (self._retention_s or _SWEEP_S) / 10)
        self._presses = presses
        self._jobs = jobs
        self._outcomes = outcomes
        self._counters = counters
        self._due = 0.0
        self._log = structlog.get_logger("hub")

    def tick(self, now: float) -> None:
        """Remove a batch of what is too old."""
        if now < self._due:
            return
        self._due = now + self._sweep_s
        try:
            self._store.retention.sweep(self._retention_s)
            if self._retention_s is None:
                return
            old = self._store.retention.expired(self._retention_s, _BATCH)
            if old:
                with self._captures.transition(CaptureEvent.EXPIRED, *old) as state:
                    self._store.retention.remove(old, state)
                self._store.retention.erase(old)
                self._counters.add("removed", "retention", len(old))
                self._log.info("removed after the retention", captures=len(old))
        except StoreError as error:
            self._log.error("not removed", reason=str(error))
            return
        if len(old) == _BATCH:
            self._due = now

    def receive(self, peer: bytes, message: _Request) -> Iterator[Output]:
        """Answer an operator."""
        match message:
            case messages.ListDead(request=request, after=after):
                yield send(peer, messages.DeadLetters(
                    request=request, letters=tuple(self._store.dead_letters(after, _PAGE))))
            case messages.RetryDead() | messages.DropDead():
                yield from self._dead_letter(peer, message)
            case messages.Purge():
                yield from self._purge(peer, message)

    def _dead_letter(self, peer: bytes, message: _DeadLetterRequest) -> Iterator[Output]:
        """Retry or drop a capture that was given up."""
        capture_id, request = message.capture_id, message.request
        retry = isinstance(message, messages.RetryDead)
        stored = self._store.find(capture_id)
        if stored is None:
            yield send(peer, messages.CaptureUnknown(request=request, capture_id=capture_id))
        elif retry and stored.state is CaptureState.ACCEPTED:  # a repeat
            yield send(peer, messages.CapturePending(request=request, capture_id=capture_id))
        elif stored.state is not CaptureState.DEAD:
            yield send(peer, messages.RequestFailed(
                request=request, message=f"capture {capture_id} is {stored.state}, no dead letter"))
        elif retry:
            self._store.frame(capture_id)  # StoreError where it is damaged: the dead letter stays
            with self._captures.transition(CaptureEvent.RETRIED, capture_id) as state:
                self._store.reopen(capture_id, state, reset_attempts=True)
            self._jobs.add(capture_id)
            self._log.info("dead letter retried", capture_id=capture_id)
            yield send(peer, messages.CapturePending(request=request, capture_id=capture_id))
        else:
            yield from self._remove([capture_id])
            yield send(peer, messages.Removed(request=request, removed=1, left=False))

    def _purge(self, peer: bytes, message: messages.Purge) -> Iterator[Output]:
        if message.capture_id is not None:
            known = self._store.find(message.capture_id)
            going = [message.capture_id] if known else []
        else:
            going = self._store.retention.accepted_before(message.before, _BATCH)
        if message.before is None:
            yield from self._presses.purge(message.capture_id)
        yield from self._remove(going)
        left = len(going) == _BATCH
        if message.everything and not left:
            self._store.retention.clear_quarantine()
        yield send(peer, messages.Removed(request=message.request, removed=len(going), left=left))

    def _remove(self, capture_ids: Sequence[str]) -> Iterator[Output]:
        if not capture_ids:
            return
        with self._captures.transition(CaptureEvent.PURGED, *capture_ids) as state:
            self._store.retention.remove(capture_ids, state)
        self._jobs.forget(capture_ids)
        self._store.retention.erase(capture_ids)
        self._counters.add("removed", "operator", len(capture_ids))
        self._log.info("removed by an operator", captures=len(capture_ids))
        yield from self._outcomes.removed(capture_ids)
