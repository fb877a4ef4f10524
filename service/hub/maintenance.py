"""Retention, dead letters, purges.

What is removed is withdrawn at once, in one quick transaction; the writer erases it beside the
hub's loop, and is asked for one batch after the other. An operator is told that captures are
removed when nothing of them is left, in no file and not in the database's log.
"""

from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from secrets import token_hex

import structlog

from denseface.service.errors import DamagedDatabaseError, StoreError
from denseface.service.hub._common import Common
from denseface.service.hub.jobs import Jobs
from denseface.service.hub.outcomes import Outcomes
from denseface.service.hub.presses import Presses
from denseface.service.monitoring import Counters
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Send, send
from denseface.service.protocol.states import CaptureEvent, CaptureState
from denseface.service.storage import Erased, PendingErasure

_BATCH = 250
"""Captures withdrawn in one go: more would stall the event loop."""
_PAGE = 50
"""Dead letters in one answer, as `DeadLetters.letters` allows."""
_SWEEP_S = 600.0
"""Longest time between two sweeps for what is too old, seconds."""
_PROMISES_S = 1.0
"""Time between two looks for what a consent promised to be gone, seconds."""
_MAX_ASKED = 64
"""Removals that may wait for their end; beyond, one is refused."""
_MAX_ASKED_PER_KEY = 16
"""Withdrawals of one key among them: whoever only presses keeps no operator from removing."""
_LOG_RETRY_S = 1.0
"""Time after which the database's log is tried again that could not be emptied, seconds."""
_LOG_WAIT_S = 5.0
"""Longest wait of an operator for that, seconds."""
_WHY = {"retention": "removed after the retention", "operator": "removed by an operator",
        "withdrawal": "removed, as it was withdrawn"}
"""Reason of a removal, by which it is counted -> what the log says."""
_LOG_READ = ("erased, but the database's log still names it: another program has the database "
             "open; the hub empties it as soon as that ends")

_DeadLetterRequest = messages.RetryDead | messages.DropDead
_Request = messages.ListDead | _DeadLetterRequest | messages.Purge


@dataclass
class _Asked:
    """A request to remove, answered when all is erased."""

    peer: bytes
    request: int
    capture_id: str | None
    """None: captures before a time, or all."""
    removed: int
    left: bool
    key: str = ""
    """Of whoever withdraws; empty for an operator, and where none was needed."""
    deadline: float = 0.0
    """Until then it waits for the database's log, seconds."""

    def fail(self, why: str) -> Send:
        return send(self.peer, messages.RequestFailed(request=self.request, message=why))


@dataclass(frozen=True)
class _Erasure:
    """An erasure under way."""

    reason: str = ""
    removed: int = 0
    """Captures that were withdrawn for it."""
    asked: _Asked | None = None


class Maintenance:
    """Removes what is too old, and does what an operator asks for."""

    def __init__(
        self, common: Common, presses: Presses, jobs: Jobs, outcomes: Outcomes, counters: Counters
    ) -> None:
        self._store, self._captures, self._writer, _, settings = common
        self._retention_s = settings.retention
        self._sweep_s = min(_SWEEP_S, (self._retention_s or _SWEEP_S) / 10)
        self._presses = presses
        self._jobs = jobs
        self._outcomes = outcomes
        self._counters = counters
        self._due = self._log_due = self._promises_due = 0.0
        self._erasures: deque[_Erasure] = deque()
        """Under way, in the order in which they end."""
        self._unsaid: list[_Asked] = []
        """Erased, but for the database's log."""
        self._log = structlog.get_logger("hub")

    def tick(self, now: float) -> Iterator[Output]:
        """Begin to remove a batch of what is too old; go on with what could not be erased."""
        for asked in [one for one in self._unsaid if now >= one.deadline]:
            self._unsaid.remove(asked)
            yield asked.fail(_LOG_READ)
        if self._sweeping():
            return
        try:
            if now >= self._promises_due:
                self._promises_due = now + _PROMISES_S
                yield from self._keep_promises(now)
            if self._sweeping():
                return
            if now >= self._due:
                self._due = now + self._sweep_s
                self._sweep(now)
            elif self._store.retention.log_due and now >= self._log_due:
                self._log_due = now + _LOG_RETRY_S
                self._erase(self._store.retention.prepare(), _Erasure())
        except DamagedDatabaseError:
            raise
        except StoreError as error:
            self._log.error("not removed", reason=str(error))

    def _sweeping(self) -> bool:
        """Whether an erasure is under way that nobody asked for; those asked for hold up none."""
        return any(one.asked is None for one in self._erasures)

    def _sweep(self, now: float) -> None:
        """Begin to erase a batch of what was withdrawn before, or else of what is too old."""
        retention = self._store.retention
        retention.save_clock()
        going, removed = retention.left_over(_BATCH), 0
        if not going and self._retention_s is not None:
            going = retention.expired(self._retention_s, _BATCH)
            removed = len(going)
            if going:
                with self._captures.transition(CaptureEvent.EXPIRED, *going) as state:
                    retention.remove(going, state)
        if len(going) == _BATCH:
            self._due = now
        self._erase(retention.prepare(going, retention_s=self._retention_s),
                    _Erasure("retention", removed))

    def _keep_promises(self, now: float) -> Iterator[Output]:
        """Begin to erase what a consent promised to be gone by now, also what has no face yet."""
        found = self._store.retention.promised(_BATCH)
        going = [one for one in found if self._captures.allows(one, CaptureEvent.PROMISED)]
        if going:
            if len(going) == _BATCH:
                self._promises_due = now
            yield from self._withdraw(going, CaptureEvent.PROMISED)
            self._erase(
                self._store.retention.prepare(going), _Erasure("retention", len(going)))

    def erased(self, now: float, results: Sequence[Erased]) -> Iterator[Output]:
        """Take what became of erasures, and answer those who wait for them."""
        for one in results:
            erasure = self._erasures.popleft()
            try:
                self._store.retention.finish(one)
            except DamagedDatabaseError:
                raise
            except StoreError as error:
                self._log.error("not removed", reason=str(error))
                if erasure.asked:
                    yield erasure.asked.fail(str(error))
                continue
            if erasure.removed:
                self._counters.add("removed", erasure.reason, erasure.removed)
                self._log.info(_WHY[erasure.reason], captures=erasure.removed)
            if asked := erasure.asked:
                asked.removed += one.without_row
                asked.deadline = now + _LOG_WAIT_S
                self._unsaid.append(asked)
            if one.log_emptied:
                # Of what ended before, too: all of it was in the log before this erasure.
                unsaid, self._unsaid = self._unsaid, []
                yield from map(self._removed, unsaid)
            else:
                self._log.warning("the database's log could not be emptied: someone reads it")

    def _removed(self, asked: _Asked) -> Send:
        left = self._store.retention.is_left(asked.capture_id)
        if left and asked.capture_id is not None:  # another erasure of it failed
            return asked.fail(f"capture {asked.capture_id} could not be erased yet")
        return send(asked.peer, messages.Removed(
            request=asked.request, removed=asked.removed, left=asked.left or left))

    def receive(self, peer: bytes, message: _Request) -> Iterator[Output]:
        """Answer an operator."""
        if self._is_repeat(peer, message.request):
            return
        if not isinstance(message, messages.ListDead) and self._is_full():
            raise StoreError(f"{_MAX_ASKED} removals are under way already")
        match message:
            case messages.ListDead(request=request, after=after):
                yield send(peer, messages.DeadLetters(
                    request=request, letters=tuple(self._store.dead_letters(after, _PAGE))))
            case messages.RetryDead() | messages.DropDead():
                yield from self._dead_letter(peer, message)
            case messages.Purge():
                yield from self._purge(peer, message)

    def withdraw(
        self, peer: bytes, message: messages.Withdraw, key: str, *, owned: bool
    ) -> Iterator[Output]:
        """Remove a capture that is not being written, whatever became of it.

        Where it is not owned, the same is done for an id that is nobody's: neither the answer nor
        the time that it takes says that there is one. StoreError where too many wait.
        """
        if self._is_repeat(peer, message.request):
            return
        own = sum(one.key == key for one in self._waiting()) if key else 0
        if self._is_full() or own >= _MAX_ASKED_PER_KEY:
            raise StoreError("too many removals are under way already")
        capture_id = message.capture_id if owned else token_hex(16)
        yield from self._presses.purge(capture_id, "it was withdrawn")
        going = [capture_id] if self._store.find(capture_id) else []
        yield from self._withdraw(going)
        self._erase(self._store.retention.prepare([capture_id]), _Erasure(
            "withdrawal", len(going),
            _Asked(peer, message.request, capture_id, len(going), left=False, key=key)))

    def _is_repeat(self, peer: bytes, request: int) -> bool:
        """Whether a request is waiting already: it is answered when all is erased."""
        return any((one.peer, one.request) == (peer, request) for one in self._waiting())

    def _is_full(self) -> bool:
        return sum(1 for _ in self._waiting()) >= _MAX_ASKED

    def _waiting(self) -> Iterator[_Asked]:
        yield from self._unsaid
        yield from (one.asked for one in self._erasures if one.asked)

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
            yield from self._withdraw([capture_id])
            self._erase(self._store.retention.prepare([capture_id]), _Erasure(
                "operator", 1, _Asked(peer, request, capture_id, removed=1, left=False)))

    def _purge(self, peer: bytes, message: messages.Purge) -> Iterator[Output]:
        retention = self._store.retention
        if message.capture_id is not None:
            known = self._store.find(message.capture_id)
            going = [message.capture_id] if known else []
        else:
            going = retention.accepted_before(message.before, _BATCH)
        if message.before is None:
            yield from self._presses.purge(message.capture_id)
        yield from self._withdraw(going)
        # With the last batch goes what an earlier hub, or a disk that failed, has left.
        left, others = message.capture_id is None and len(going) == _BATCH, list[str]()
        if message.capture_id is not None:
            others = [message.capture_id]
        elif not left:
            others = retention.left_over(_BATCH)
            if message.everything:
                others += retention.without_row()
        self._erase(
            retention.prepare([*going, *others], all_quarantined=message.everything and not left),
            _Erasure("operator", len(going), _Asked(
                peer, message.request, message.capture_id, len(going), left)))

    def _withdraw(
        self, capture_ids: Sequence[str], event: CaptureEvent = CaptureEvent.PURGED
    ) -> Iterator[Output]:
        if capture_ids:
            with self._captures.transition(event, *capture_ids) as state:
                self._store.retention.remove(capture_ids, state)
            gone = frozenset(capture_ids)
            self._jobs.forget(gone)
            yield from self._outcomes.removed(gone)

    def _erase(self, pending: PendingErasure, erasure: _Erasure) -> None:
        self._erasures.append(erasure)
        self._writer.erase(pending)
