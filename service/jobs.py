"""The hub's second half: a kept frame becomes an outcome, whatever happens to the workers."""

from collections import deque
from collections.abc import Callable, Collection, Iterator

import structlog
from pydantic import ValidationError

from recon.settings import Settings
from service import messages
from service.errors import CorruptFileError, ProtocolError, StoreError
from service.failpoints import failpoint
from service.outputs import Output, send
from service.refusals import Refusals
from service.roster import Roster, Worker
from service.states import CaptureEvent, CaptureState, advance
from service.stored import Store, Stored
from service.wire import Packet

__all__ = ["Jobs"]

_LOST = ("WorkerLost", "the worker that held it went away")
_MOST_UNKEPT = 16
_PAUSE_S = 1.0
"""Time until what the disk refused is tried again, seconds."""


class Jobs:
    """Frames that wait for a worker or are held by one."""

    def __init__(
        self, store: Store, roster: Roster, attempts: int,
        concluded: Callable[[str], Iterator[Output]], refusals: Refusals,
    ) -> None:
        """Take up what the store has unfinished; `concluded` announces an outcome."""
        self._store = store
        self._roster = roster
        self._attempts = attempts
        self._concluded = concluded
        self._refusals = refusals
        self._queue = deque(store.unfinished())
        self._reasons: dict[str, tuple[str, str]] = {}
        self._unkept: deque[tuple[messages.Result, Packet]] = deque()
        """Results that the disk refused; workers get nothing new meanwhile."""
        self._paused_until = 0.0
        self._log = structlog.get_logger("hub")
        if self._queue:
            self._log.info("resumed", accepted=len(self._queue))

    @property
    def queued(self) -> int:
        """Frames that wait for a worker."""
        return len(self._queue)

    @property
    def working(self) -> int:
        """Frames held by a worker."""
        return sum(worker.job is not None for worker in self._roster.workers.values())

    def add(self, capture_id: str) -> None:
        """Queue a frame that was just kept."""
        if capture_id not in self._queue:
            self._queue.append(capture_id)

    def forget(self, capture_ids: Collection[str]) -> None:
        """Drop captures that were removed, from workers' hands too."""
        self._queue = deque(one for one in self._queue if one not in capture_ids)
        for capture_id in capture_ids:
            self._reasons.pop(capture_id, None)
        for worker in self._roster.workers.values():
            if worker.job in capture_ids:
                worker.job = None

    def remake(self, capture_id: str, reason: str, *, attempts_left: bool = True) -> None:
        """Take up a capture again whose face turned out to be damaged."""
        self._store.reopen(capture_id, attempts_left=attempts_left)
        self._reasons[capture_id] = "CorruptFileError", reason
        self.add(capture_id)
        self._log.warning("face to be made again", capture_id=capture_id, reason=reason)

    def dispatch(self, now: float) -> Iterator[Output]:
        """Give frames to free workers, oldest first; give up what has no attempt left.

        While the disk refuses what is to be kept, nothing new is begun.
        """
        if now < self._paused_until:
            return
        try:
            yield from self._keep_refused()
            yield from self._dispatch(now)
        except StoreError as error:
            self._pause(now, str(error))

    def _keep_refused(self) -> Iterator[Output]:
        while self._unkept:
            message, packet = self._unkept[0]
            useful = self._of_use(message, CaptureEvent.RESULT)
            if useful:
                self._store.finish(packet)
            self._unkept.popleft()
            if useful:
                self._log.info("done", capture_id=message.capture_id)
                yield from self._concluded(message.capture_id)

    def _pause(self, now: float, reason: str) -> None:
        self._paused_until = now + _PAUSE_S
        self._log.error("the disk refuses, work waits", reason=reason, unkept=len(self._unkept))

    def _dispatch(self, now: float) -> Iterator[Output]:
        while self._queue:
            capture_id = self._queue[0]
            stored = self._store.find(capture_id)
            if stored is None or stored.state is not CaptureState.ACCEPTED:
                self._queue.popleft()
            elif stored.attempts >= self._attempts:
                yield from self._give_up(capture_id, *self._reasons.get(capture_id, _LOST))
            elif worker := self._roster.free_worker():
                yield from self._give(now, capture_id, stored, worker)
            else:
                return

    def next_job(self, now: float, peer: bytes, answer: messages.Result) -> Iterator[Output]:
        """Give a worker its next frame before its answer is kept: it need not wait for the disk.

        Its answer counts as its next `WorkerReady`, which then asks for nothing new.
        """
        worker = self._roster.workers.get(peer)
        if (worker and worker.job == answer.capture_id
                and self._of_use(answer, CaptureEvent.RESULT)):
            self._roster.answered(worker)
            yield from self.dispatch(now)

    def result(
        self, now: float, peer: bytes, message: messages.Result, packet: Packet
    ) -> Iterator[Output]:
        """Keep and announce a face, unless this capture has its outcome."""
        failpoint("hub.result.received")
        capture_id = message.capture_id
        if not self._expected(peer, message, CaptureEvent.RESULT):
            return
        try:
            message.face.join(packet.arrays)
            self._store.finish(packet)
        except ProtocolError as error:
            self._retry(capture_id, type(error).__name__, str(error))
        except StoreError as error:
            self._pause(now, str(error))
            if len(self._unkept) < _MOST_UNKEPT:
                self._unkept.append((message, packet))
            else:
                self._retry(capture_id, type(error).__name__, str(error))
        else:
            self._log.info("done", capture_id=capture_id)
            yield from self._concluded(capture_id)

    def failed(self, peer: bytes, message: messages.JobFailed) -> Iterator[Output]:
        """Announce "no face", or try again."""
        event = CaptureEvent.REJECTED if message.final else CaptureEvent.LOST
        if not self._expected(peer, message, event):
            return
        capture_id = message.capture_id
        if not message.final:
            self._retry(capture_id, message.error, message.message)
            return
        try:
            self._store.fail(capture_id, message.error, message.message, dead=False)
        except StoreError as error:
            self._retry(capture_id, type(error).__name__, str(error))
        else:
            self._log.info("failed", capture_id=capture_id, error=message.error)
            yield from self._concluded(capture_id)

    def lost(self, worker: Worker) -> None:
        """Take back what a worker held that went away or came back without an answer."""
        capture_id, worker.job = worker.job, None
        if capture_id and self._state(capture_id) is CaptureState.ACCEPTED:
            self._retry(capture_id, *_LOST)

    def handed_back(self, worker: Worker) -> None:
        """Take back what a worker held that was told to stop; as an attempt it does not count."""
        capture_id, worker.job = worker.job, None
        if capture_id and self._state(capture_id) is CaptureState.ACCEPTED:
            try:
                self._store.take_back_attempt(capture_id)
            except StoreError as error:
                self._log.warning("attempt not taken back", reason=str(error))
            self._retry(capture_id, "HandedBack", "the worker that held it was stopped")

    def _give(
        self, now: float, capture_id: str, stored: Stored, worker: Worker
    ) -> Iterator[Output]:
        try:
            kept = self._store.frame(capture_id)
            settings = Settings.model_validate_json(kept.about.settings)
        except (CorruptFileError, ValidationError) as error:
            yield from self._give_up(capture_id, type(error).__name__, str(error))
            return
        attempt = self._store.start_attempt(capture_id)
        self._queue.popleft()
        worker.free, worker.job, worker.seen = False, capture_id, now
        self._log.info("dispatched", capture_id=capture_id, worker=worker.name, attempt=attempt)
        yield send(worker.peer, messages.Job(
            capture_id=capture_id, attempt=attempt, settings=settings,
            settings_hash=stored.settings_hash, frame_sha256=stored.frame_sha256,
            frame=kept.message.frame), kept.arrays)

    def _give_up(self, capture_id: str, error: str, reason: str) -> Iterator[Output]:
        self._store.fail(capture_id, error, reason, dead=True)
        self._queue.popleft()
        self._reasons.pop(capture_id, None)
        self._log.error("dead letter", capture_id=capture_id, error=error, reason=reason)
        yield from self._concluded(capture_id)

    def _retry(self, capture_id: str, error: str, reason: str) -> None:
        if capture_id not in self._queue and self._holder(capture_id) is None:
            self._log.warning(
                "to be tried again", capture_id=capture_id, error=error, reason=reason)
            self._reasons[capture_id] = error, reason
            self._queue.appendleft(capture_id)

    def _expected(
        self, peer: bytes, answer: messages.Result | messages.JobFailed, event: CaptureEvent
    ) -> bool:
        """Say whether an answer is of use; whoever held the job holds it no more."""
        capture_id = answer.capture_id
        useful = self._of_use(answer, event)
        worker = self._roster.workers.get(peer)
        if worker and worker.job == capture_id:
            worker.job = None
            if not useful and self._state(capture_id) is CaptureState.ACCEPTED:
                self._retry(capture_id, "RemoteProtocolError", "the answer was to another job")
        if not useful:
            self._refusals.note("replayed", capture_id=capture_id, detail=f"{event}, not asked for")
        return useful

    def _of_use(
        self, answer: messages.Result | messages.JobFailed, event: CaptureEvent
    ) -> bool:
        stored = self._store.find(answer.capture_id)
        asked = stored and (stored.settings_hash, stored.frame_sha256)
        return (asked == (answer.settings_hash, answer.frame_sha256)
                and advance(self._state(answer.capture_id), event) is not None)

    def _state(self, capture_id: str) -> CaptureState | None:
        stored = self._store.find(capture_id)
        if stored is None:
            return None
        held = stored.state is CaptureState.ACCEPTED and self._holder(capture_id)
        return CaptureState.WORKING if held else stored.state

    def _holder(self, capture_id: str) -> Worker | None:
        return next((worker for worker in self._roster.workers.values()
                     if worker.job == capture_id), None)
