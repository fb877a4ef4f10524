"""Outcomes are published, and sent to whoever asks for them."""

from collections.abc import Callable, Collection, Iterator
from typing import NamedTuple

from denseface.service.errors import DamagedFaceError
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Publish, Send, send
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.storage import FolderStore

_MAX_WAITERS = 1000
"""Requests that may wait for an outcome; beyond, they are answered at once."""
_MAX_WAITERS_PER_KEY = 100
"""As `_MAX_WAITERS`, with one key; where none is needed, of one client."""


class _Waiter(NamedTuple):
    capture_id: str
    deadline: float
    key: str


class Outcomes:
    """Outcomes, and the requests that wait for one."""

    def __init__(
        self, store: FolderStore, requeue_damaged: Callable[[DamagedFaceError, bool], None]
    ) -> None:
        """Read outcomes from a store; `requeue_damaged` has a damaged face made again.

        Its flag is False where the face was damaged as soon as it was written: an attempt.
        """
        self._store = store
        self._requeue_damaged = requeue_damaged
        self._waiters: dict[tuple[bytes, int], _Waiter] = {}
        """By client and request."""

    def publish(self, capture_id: str) -> Iterator[Output]:
        """Publish the outcome of a capture and answer the requests that wait for it."""
        try:
            packet = self._store.outcome(capture_id)
        except DamagedFaceError as error:
            self._requeue_damaged(error, False)
            return
        if packet:
            yield Publish(Topic.FACES, packet)
            for peer, request, _ in self._take_waiters([capture_id]):
                yield _answer(peer, request, packet)

    def _may_wait(self, peer: bytes, key: str) -> bool:
        own = sum(waiter.key == key if key else one == peer
                  for (one, _), waiter in self._waiters.items())
        return len(self._waiters) < _MAX_WAITERS and own < _MAX_WAITERS_PER_KEY

    def removed(self, capture_ids: Collection[str]) -> Iterator[Output]:
        """Answer the requests that wait for captures that were removed."""
        for peer, request, capture_id in self._take_waiters(capture_ids):
            yield send(peer, messages.CaptureUnknown(request=request, capture_id=capture_id))

    def _take_waiters(self, capture_ids: Collection[str]) -> list[tuple[bytes, int, str]]:
        waiting = [(*key, waiter.capture_id) for key, waiter in self._waiters.items()
                   if waiter.capture_id in capture_ids]
        for peer, request, _ in waiting:
            del self._waiters[peer, request]
        return waiting

    def get_face(
        self, now: float, peer: bytes, message: messages.GetFace, key: str = ""
    ) -> Iterator[Output]:
        """Send an outcome, or let the request wait for it."""
        capture_id, request = message.capture_id, message.request
        try:
            packet = self._store.outcome(capture_id)
        except DamagedFaceError as error:
            self._requeue_damaged(error, True)
            packet = None
        if packet:
            yield _answer(peer, request, packet)
        elif self._store.find(capture_id) is None:
            yield send(peer, messages.CaptureUnknown(request=request, capture_id=capture_id))
        elif (peer, request) in self._waiters:
            return  # a repeat: its wait does not begin anew
        elif message.wait_s > 0 and self._may_wait(peer, key):
            self._waiters[peer, request] = _Waiter(capture_id, now + message.wait_s, key)
        else:
            yield send(peer, messages.CapturePending(request=request, capture_id=capture_id))

    def get_frame(self, peer: bytes, message: messages.GetFrame) -> Iterator[Output]:
        """Send the frame of a capture; StoreError where it is damaged."""
        capture_id, request = message.capture_id, message.request
        if self._store.find(capture_id) is None:
            yield send(peer, messages.CaptureUnknown(request=request, capture_id=capture_id))
            return
        record = self._store.kept_frame(capture_id)
        yield Send(peer, Packet(messages.FrameKept(
            request=request, capture_id=capture_id, frame=record.message.frame), record.arrays))

    def get_next(self, peer: bytes, message: messages.GetNext) -> Iterator[Output]:
        """Send the first undamaged outcome after a sequence number."""
        if packet := self._next(message.after):
            yield _answer(peer, message.request, packet)
        else:
            yield send(peer, messages.NothingNewer(
                request=message.request, epoch=self._store.epoch,
                sequence=self._store.last_sequence()))

    def _next(self, after: int) -> Packet | None:
        while True:
            try:
                return self._store.outcome_after(after)
            except DamagedFaceError as error:
                self._requeue_damaged(error, True)

    def find_start(self, peer: bytes, message: messages.FindStart) -> Iterator[Output]:
        """Send the sequence number before the first outcome that is asked for."""
        if message.since is not None:
            sequence = self._store.sequence_before_time(message.since)
        else:
            sequence = self._store.sequence_before_last(message.last or 1)
        yield send(peer, messages.StartAt(
            request=message.request, epoch=self._store.epoch, sequence=sequence))

    def tick(self, now: float) -> Iterator[Output]:
        """Answer the requests whose wait is over."""
        for peer, request in [key for key, one in self._waiters.items() if now >= one.deadline]:
            capture_id = self._waiters.pop((peer, request)).capture_id
            yield send(peer, messages.CapturePending(request=request, capture_id=capture_id))


def _answer(peer: bytes, request: int, packet: Packet) -> Send:
    message = packet.message.model_copy(update={"request": request})
    return Send(peer, Packet(message, packet.arrays))
