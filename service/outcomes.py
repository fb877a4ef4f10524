"""The hub's last part: outcomes are published, and given to whoever asks."""

from collections.abc import Iterator
from dataclasses import dataclass

from service import messages
from service.outputs import Output, Publish, Send, Topic, send
from service.store import Store
from service.wire import Packet

__all__ = ["Outcomes"]

_MAX_WAITERS = 1000


@dataclass(frozen=True)
class _Waiter:
    capture_id: str
    request: int
    deadline: float


class Outcomes:
    """What ended, and who waits for what has not."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._waiters: dict[bytes, _Waiter] = {}
        """A client waits for one capture at a time."""

    def concluded(self, capture_id: str) -> Iterator[Output]:
        """Publish the outcome of a capture and answer those who wait for it."""
        if packet := self._store.outcome(capture_id):
            yield Publish(Topic.FACES, packet)
            waiting = [peer for peer, waiter in self._waiters.items()
                       if waiter.capture_id == capture_id]
            for peer in waiting:
                yield _answer(peer, self._waiters.pop(peer).request, packet)

    def get_face(self, now: float, peer: bytes, message: messages.GetFace) -> Iterator[Output]:
        """Give an outcome, or note that someone waits for it."""
        capture_id, request = message.capture_id, message.request
        if packet := self._store.outcome(capture_id):
            yield _answer(peer, request, packet)
        elif self._store.find(capture_id) is None:
            yield send(peer, messages.CaptureUnknown(request=request, capture_id=capture_id))
        elif message.wait_s > 0 and len(self._waiters) < _MAX_WAITERS:
            self._waiters[peer] = _Waiter(capture_id, request, now + message.wait_s)
        else:
            yield send(peer, messages.CapturePending(request=request, capture_id=capture_id))

    def get_next(self, peer: bytes, message: messages.GetNext) -> Iterator[Output]:
        """Give the first outcome after a sequence number."""
        if packet := self._store.outcome_after(message.after):
            yield _answer(peer, message.request, packet)
        else:
            yield send(peer, messages.NothingNewer(
                request=message.request, epoch=self._store.epoch,
                sequence=self._store.last_sequence()))

    def tick(self, now: float) -> Iterator[Output]:
        """Answer those who waited long enough."""
        for peer in [peer for peer, waiter in self._waiters.items() if now >= waiter.deadline]:
            waiter = self._waiters.pop(peer)
            yield send(peer, messages.CapturePending(
                request=waiter.request, capture_id=waiter.capture_id))


def _answer(peer: bytes, request: int, packet: Packet) -> Send:
    message = packet.message.model_copy(update={"request": request})
    return Send(peer, Packet(message, packet.arrays))
