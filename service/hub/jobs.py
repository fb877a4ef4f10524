"""From a saved frame to an outcome, whatever happens to the workers."""

from collections import defaultdict, deque
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress

import structlog
from pydantic import ValidationError

from denseface.recon.settings import Settings
from denseface.service.errors import (
    CorruptFileError,
    ProtocolError,
    ServiceError,
    StoreError,
)
from denseface.service.hub._common import Common
from denseface.service.hub.answers import Attempts, JobFacts, check_result
from denseface.service.hub.peers import WorkerPeer
from denseface.service.hub.unsaved_faces import UnsavedFaces
from denseface.service.monitoring import Counters, Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, send
from denseface.service.protocol.states import CaptureEvent, CaptureState
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.failpoints import failpoint
from denseface.service.storage import CaptureRow, WriteResult

_LOST = ("WorkerLost", "the worker that held it went away")
"""Error and reason of a job whose worker is gone."""
_MAX_HANDED_BACK = 16
"""Times that a capture may be handed back, beyond which each counts as an attempt: else a worker
that takes and gives it back for ever would keep it from its end."""
_MAX_TAKEN_BACK = 4096
"""Jobs that were taken back from workers and whose late answers are expected."""
_RETRY_S = 1.0
"""Time after which the disk is tried again that refused something, seconds."""


class Jobs:
    """Frames that wait for a worker or are held by one."""

    def __init__(
        self, common: Common, publish: Callable[[str], Iterator[Output]], rejections: Rejections,
        counters: Counters,
    ) -> None:
        """Queue what the store has unfinished; `publish` publishes a capture's outcome."""
        self._store, self._captures, writer, self._peers, settings = common
        self._max_attempts = settings.attempts
        # A worker that keeps to this ends itself first: the hub hears no lie, only silence.
        self._lease_s = settings.job_timeout_s + settings.silence_s
        self._publish = publish
        self._rejections = rejections
        self._counters = counters
        self._queue = deque(self._store.unfinished())
        self._attempts: defaultdict[str, Attempts] = defaultdict(Attempts)
        """Of captures that have no outcome."""
        self._taken_back: BoundedDict[tuple[str, str], int] = BoundedDict(_MAX_TAKEN_BACK)
        """Capture and key -> jobs of which its workers do not know that they were taken back."""
        self._unsaved_faces = UnsavedFaces(self._store, writer)
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
        return sum(len(worker.jobs) for worker in self._peers.workers.values())

    def add(self, capture_id: str) -> None:
        """Queue a capture that is ACCEPTED."""
        if capture_id not in self._queue:
            self._queue.append(capture_id)

    def forget(self, capture_ids: Collection[str]) -> None:
        """Drop captures that were removed, from the workers' jobs too."""
        self._queue = deque(one for one in self._queue if one not in capture_ids)
        for capture_id in capture_ids:
            self._attempts.pop(capture_id, None)
            self._unsaved_faces.drop(capture_id)
        for worker in self._peers.workers.values():
            if worker.jobs and worker.jobs[0] in capture_ids:
                worker.deadline += self._lease_s  # it does not know, and goes on with it first
            self._expect_late(worker, capture_ids)
            worker.jobs = [one for one in worker.jobs if one not in capture_ids]

    def requeue_damaged(self, capture_id: str, reason: str, *, reset_attempts: bool = True) -> None:
        """Have a damaged face made again; without `reset_attempts` attempts go on counting."""
        with self._captures.transition(CaptureEvent.DAMAGED, capture_id) as state:
            self._store.reopen(capture_id, state, reset_attempts=reset_attempts)
        self._attempts[capture_id].last_error = "CorruptFileError", reason
        self.add(capture_id)
        self._log.warning("face to be made again", capture_id=capture_id, reason=reason)

    def dispatch(self, now: float) -> Iterator[Output]:
        """Send frames to free workers, oldest first; give up what has no attempt left.

        While the disk refuses writes, or many faces wait for it, no job is sent.
        """
        if now < self._paused_until:
            return
        try:
            if self._unsaved_faces.retry_refused():
                yield from self._dispatch(now)
        except StoreError as error:
            self._pause(now, str(error))

    def _pause(self, now: float, reason: str) -> None:
        self._paused_until = now + _RETRY_S
        self._log.error(
            "disk refuses writes, jobs wait", reason=reason, unsaved=len(self._unsaved_faces))

    def _dispatch(self, now: float) -> Iterator[Output]:
        while self._queue:
            capture_id = self._queue[0]
            stored = self._store.find(capture_id)
            if stored is None or not self._captures.allows(capture_id, CaptureEvent.DISPATCHED):
                self._queue.popleft()
                if stored is None:
                    self._attempts.pop(capture_id, None)
            elif stored.attempts >= self._max_attempts:
                yield from self._give_up(
                    capture_id, *(self._attempts[capture_id].last_error or _LOST))
            # A frame that may have killed a worker is tried alone: no other is lost with it.
            elif worker := self._peers.free_worker(alone=stored.attempts > 0):
                yield from self._send_job(now, capture_id, stored, worker)
            else:
                return

    def result(
        self, now: float, peer: bytes, message: messages.Result, packet: Packet, key: str
    ) -> None:
        """Begin to save a face, unless this capture has one; `written` is told what came of it."""
        failpoint("hub.result.received")
        if self._take_answer(now, peer, message, CaptureEvent.RESULT, key):
            try:
                check_result(message, packet.arrays, self._facts(message.capture_id), now)
                self._unsaved_faces.save(packet)
            except (ProtocolError, StoreError) as error:
                if isinstance(error, ProtocolError):
                    self._rejections.note("untrue", key=key, capture_id=message.capture_id,
                                          detail=str(error))
                self._take_back(message.capture_id, type(error).__name__, str(error))
            else:
                self._captures.advance(message.capture_id, CaptureEvent.RESULT)

    def written(self, now: float, faces: Sequence[WriteResult]) -> Iterator[Output]:
        """Give faces their rows, in order, and publish them; those that the disk refused wait."""
        # All rows first: an error raised below loses none.
        for one, error in list(self._captures.save(CaptureEvent.FACE_SAVED, faces)):
            capture_id = one.pending.capture_id
            if error is None:
                self._unsaved_faces.drop(capture_id)
                self._attempts.pop(capture_id, None)
                self._log.info("done", capture_id=capture_id)
                yield from self._publish_safely(capture_id)
                continue
            if isinstance(error, StoreError):
                self._pause(now, str(error))
            if not self._unsaved_faces.refused(capture_id, error):
                self._captures.advance(capture_id, CaptureEvent.FACE_DROPPED)
                self._requeue(capture_id, type(error).__name__, str(error))
            if not isinstance(error, ServiceError):
                raise error

    def _publish_safely(self, capture_id: str) -> Iterator[Output]:
        try:
            yield from self._publish(capture_id)
        except StoreError as error:  # subscribers see the gap and ask for it
            self._log.error("not published", capture_id=capture_id, reason=str(error))

    def failed(
        self, now: float, peer: bytes, message: messages.JobFailed, key: str
    ) -> Iterator[Output]:
        """Publish "no face", or try again."""
        event = CaptureEvent.REJECTED if message.final else CaptureEvent.LOST
        if not self._take_answer(now, peer, message, event, key):
            return
        capture_id = message.capture_id
        if not message.final:
            self._take_back(capture_id, message.error, message.message)
            return
        try:
            with self._captures.transition(event, capture_id) as state:
                self._store.fail(capture_id, state, message.error, message.message)
        except StoreError as error:
            self._take_back(capture_id, type(error).__name__, str(error))
        else:
            self._attempts.pop(capture_id, None)
            self._log.info("failed", capture_id=capture_id, error=message.error)
            yield from self._publish(capture_id)

    def tick(self, now: float) -> None:
        """Take the jobs of workers that held one for too long, and forget these workers."""
        for worker in self._peers.overdue(now):
            del self._peers.workers[worker.peer]
            reason = f"a worker held it for more than {self._lease_s:g} s"
            self._log.warning("worker gone", name=worker.name, reason=reason)
            self._counters.add("overdue")
            self.worker_lost(worker, ("JobOverdue", reason))

    def worker_lost(self, worker: WorkerPeer, why: tuple[str, str] = _LOST) -> None:
        """Queue again what a worker held that is gone; only its first job counts as an attempt."""
        self._expect_late(worker, worker.jobs)
        self.hand_back(worker, worker.jobs[1:])
        while worker.jobs:
            self._take_back(worker.jobs.pop(), *why)

    def _expect_late(self, worker: WorkerPeer, capture_ids: Collection[str]) -> None:
        """Note which jobs of a worker are taken from it that it may answer all the same."""
        for capture_id in worker.jobs:
            if capture_id in capture_ids:
                one = capture_id, worker.key
                self._taken_back[one] = self._taken_back.get(one, 0) + 1

    def _is_late(self, capture_id: str, key: str) -> bool:
        """Say whether an answer is to a job that was taken back from a worker; once for each."""
        if not (times := self._taken_back.pop((capture_id, key), 0)):
            return False
        if times > 1:
            self._taken_back[capture_id, key] = times - 1
        return True

    def hand_back(self, worker: WorkerPeer, capture_ids: Sequence[str]) -> None:
        """Queue jobs of a worker again; they count as no attempt, unless that happens too often."""
        for capture_id in reversed(capture_ids):
            worker.jobs.remove(capture_id)
            known = self._attempts.get(capture_id)  # None: another worker ended it
            if known:
                known.handed_back += 1
            if known is None or known.handed_back <= _MAX_HANDED_BACK:
                self._undo_attempt(capture_id)
            self._take_back(capture_id, "HandedBack", "the worker that held it was stopped",
                            CaptureEvent.HANDED_BACK)

    def _undo_attempt(self, capture_id: str) -> None:
        try:
            self._store.undo_attempt(capture_id)
        except StoreError as error:
            self._log.warning("attempt still counted", reason=str(error))

    def _send_job(
        self, now: float, capture_id: str, stored: CaptureRow, worker: WorkerPeer
    ) -> Iterator[Output]:
        try:
            kept = self._store.frame(capture_id)
            settings = Settings.model_validate_json(kept.metadata.settings)
        except (CorruptFileError, ValidationError) as error:
            yield from self._give_up(capture_id, type(error).__name__, str(error))
            return
        attempt = self._store.start_attempt(capture_id)
        self._queue.popleft()
        if not worker.jobs:
            worker.seen, worker.deadline = now, now + self._lease_s
        sent = self._attempts[capture_id]
        if sent.facts is None:
            sent.facts = JobFacts(settings, kept.message.frame, now)
            sent.by_earlier_hub = attempt > 1
        sent.keys.add(worker.key)
        worker.free, worker.alone = False, attempt > 1
        worker.jobs.append(capture_id)
        self._captures.advance(capture_id, CaptureEvent.DISPATCHED)
        self._log.info("dispatched", capture_id=capture_id, worker=worker.name, attempt=attempt)
        yield send(worker.peer, messages.Job(
            capture_id=capture_id, attempt=attempt, settings=settings,
            settings_hash=stored.settings_hash, frame_sha256=stored.frame_sha256,
            frame=kept.message.frame), kept.arrays)

    def _give_up(self, capture_id: str, error: str, reason: str) -> Iterator[Output]:
        with self._captures.transition(CaptureEvent.EXHAUSTED, capture_id) as state:
            self._store.fail(capture_id, state, error, reason)
        self._queue.popleft()
        self._attempts.pop(capture_id, None)
        self._log.error("dead letter", capture_id=capture_id, error=error, reason=reason)
        yield from self._publish(capture_id)

    def _take_back(
        self, capture_id: str, error: str, reason: str, event: CaptureEvent = CaptureEvent.LOST
    ) -> None:
        """Queue a capture again that left a worker's jobs, unless another worker has it too."""
        if self._holder(capture_id) is None:
            with suppress(StoreError):
                if self._captures.allows(capture_id, event):
                    self._captures.advance(capture_id, event)
        self._requeue(capture_id, error, reason)

    def _requeue(self, capture_id: str, error: str, reason: str) -> None:
        """Put a capture at the head of the queue that waits for a face and is with no worker.

        Where the store cannot be read it is queued as well: `dispatch` checks again.
        """
        with suppress(StoreError):
            if (self._captures.state(capture_id) is not CaptureState.ACCEPTED
                    or self._holder(capture_id)):
                return
        if capture_id not in self._queue:
            self._log.warning(
                "to be tried again", capture_id=capture_id, error=error, reason=reason)
            self._attempts[capture_id].last_error = error, reason
            self._queue.appendleft(capture_id)

    def _take_answer(
        self, now: float, peer: bytes, answer: messages.Result | messages.JobFailed,
        event: CaptureEvent, key: str,
    ) -> bool:
        """Take an answered job from its worker and say whether the answer is expected."""
        capture_id = answer.capture_id
        stored = self._store.find(capture_id)
        useful = (
            stored is not None and stored.settings_hash == answer.settings_hash
            and stored.frame_sha256 == answer.frame_sha256
            and self._captures.allows(capture_id, event) and self._was_sent(stored, key))
        worker = self._peers.workers.get(peer)
        held = worker is not None and capture_id in worker.jobs
        if worker and held:
            at = worker.jobs.index(capture_id)
            # Jobs are answered in order: the answers to those before it were lost.
            before, worker.jobs = worker.jobs[:at], worker.jobs[at + 1:]
            worker.deadline = now + self._lease_s
            for one in before if useful else [*before, capture_id]:
                reason = ("the answer was to another job" if one == capture_id
                          else "its answer was lost")
                self._take_back(one, "RemoteProtocolError", reason)
        late = not held and self._is_late(capture_id, key)
        if not useful:
            what = f"{event}, not asked for"
            if late:
                self._log.info("late answer dropped", capture_id=capture_id, detail=what)
            else:
                self._rejections.note("replayed", capture_id=capture_id, detail=what)
        return useful

    def _was_sent(self, stored: CaptureRow, key: str) -> bool:
        """Say whether a job was sent to workers of this key, or by an earlier hub to anybody.

        Then its answer names the frame's checksum, which only they know.
        """
        known = self._attempts.get(stored.capture_id)
        if known is None or known.facts is None:
            return stored.attempts > 0
        return known.by_earlier_hub or key in known.keys

    def _facts(self, capture_id: str) -> JobFacts:
        """Give what the job said; StoreError where it has to be read and cannot."""
        known = self._attempts.get(capture_id)
        if known and known.facts:
            return known.facts
        kept = self._store.frame(capture_id)
        try:
            settings = Settings.model_validate_json(kept.metadata.settings)
        except ValidationError as error:
            raise CorruptFileError(f"capture {capture_id}: settings of another version") from error
        return JobFacts(settings, kept.message.frame)

    def _holder(self, capture_id: str) -> WorkerPeer | None:
        return next((worker for worker in self._peers.workers.values()
                     if capture_id in worker.jobs), None)
