"""A hub in a thread, with real sockets, for the clients: answers as it is told."""

import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import zmq

from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.message_base import BaseMessage, CaptureSummary, DeadLetter
from denseface.service.protocol.payload import FaceHeader, FrameHeader, PreviewHeader
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet, decode_to_hub, encode
from denseface.service.transport.addresses import publications_of
from tests.unit.service.faces import small_face, small_frame
from tests.waiting import LIMIT_S


class FakeHub:
    """Keeps outcomes, publishes them where it is told to; answers no `ignored` kinds."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.outcomes: list[Packet] = []
        self.frames: set[str] = set()
        """Captures of which a frame is kept."""
        self.ignored: set[str] = set()
        self.garble_header: Callable[[bytes], bytes] = bytes
        """What becomes of the header of an answer."""
        self.refuse: str | None = None
        self.refuse_reason: messages.PressReason = "disk"
        self.hint: Hint | None = None
        self.presses: list[messages.Press] = []
        """Those that were answered."""
        self.pressed: list[str] = []
        """Captures, those of ignored presses too."""
        self.removals: list[tuple[int, bool]] = []
        """What the next purges are told."""
        self.received: list[str] = []
        """Kinds of what was asked; a request that is repeated counts once."""
        self.subscriptions: list[bytes] = []
        self._requests: dict[tuple[bytes, str, int], list[Packet]] = {}
        """Peer, kind and number -> answers, none where the request was ignored."""
        self._context = zmq.Context()
        self._router = self._context.socket(zmq.ROUTER)
        self._publisher = self._context.socket(zmq.XPUB)
        self._publisher.set(zmq.XPUB_VERBOSER, 1)
        self._router.bind(address)
        self._publisher.bind(publications_of(address))
        self._calls: list[Callable[[], None]] = []
        self._stop = False
        self._changed = threading.Condition()
        self._thread = threading.Thread(target=self._serve)
        self._thread.start()

    def close(self) -> None:
        self._stop = True
        self._thread.join()
        self._context.destroy(linger=0)

    def wait(self, true: Callable[[], bool]) -> None:
        with self._changed:
            assert self._changed.wait_for(true, LIMIT_S), (self.received, self.subscriptions)

    def subscribers(self, topic: Topic) -> int:
        name = topic.encode()
        return self.subscriptions.count(b"\1" + name) - self.subscriptions.count(b"\0" + name)

    def conclude(self, capture_id: str, *, published: bool = True) -> None:
        header, arrays = FaceHeader.of(small_face())
        packet = Packet(messages.FaceDone(
            epoch="0f", sequence=len(self.outcomes) + 1, capture_id=capture_id, face=header),
            arrays)
        self.outcomes.append(packet)
        if published:
            self.publish(Topic.FACES, packet)

    def preview(self, sequence: int) -> None:
        self.publish(Topic.PREVIEW, Packet(messages.Preview(
            epoch="0f", sequence=sequence,
            preview=PreviewHeader(width=2, height=1, timestamp_us=sequence)),
            {"image": np.full((1, 2, 3), sequence, np.uint8)}))

    def jpeg(self, sequence: int, data: bytes, sensor: str, hint: Hint | None = None) -> None:
        header, arrays = PreviewHeader.of_jpeg(data, sequence, hint)
        self.publish(Topic.PREVIEW, Packet(messages.Preview(
            epoch="0f", sequence=sequence,
            preview=header.model_copy(update={"sensor": sensor})), arrays))

    def publish(self, topic: Topic, packet: Packet) -> None:
        self._calls.append(
            lambda: self._publisher.send_multipart([topic.encode(), *encode(packet)]))

    def garble(self, topic: Topic) -> None:
        self._calls.append(lambda: self._publisher.send_multipart([topic.encode(), b"?"]))

    def status(self, request: int = 0, **more: Any) -> messages.Status:
        return messages.Status(
            request=request, epoch="0f", sequence=len(self.outcomes), hub_version="0",
            sensors=("s",), workers=(), pressed=0, queued=0, working=0, done=0, failed=0, dead=0,
            **more)

    def _serve(self) -> None:
        poller = zmq.Poller()
        poller.register(self._router, zmq.POLLIN)
        poller.register(self._publisher, zmq.POLLIN)
        while not self._stop:
            ready = dict(poller.poll(5))
            with self._changed:
                while self._calls:
                    self._calls.pop(0)()
                if self._publisher in ready:
                    self.subscriptions.append(self._publisher.recv())
                if self._router in ready:
                    peer, *parts = self._router.recv_multipart()
                    for answer in self._answered(peer, decode_to_hub(parts).message):
                        header, *arrays = encode(answer)
                        self._router.send_multipart([peer, self.garble_header(header), *arrays])
                self._changed.notify_all()

    def _answered(self, peer: bytes, message: BaseMessage) -> list[Packet]:
        """Answer a request once: it is repeated where the machine stands still for a while."""
        request = peer, message.kind, getattr(message, "request", 0)
        if request not in self._requests:
            self.received.append(message.kind)
            if isinstance(message, messages.Press):
                self.pressed.append(message.capture_id)
        if not self._requests.get(request):
            self._requests[request] = (
                [] if message.kind in self.ignored else [*self._answers(message)])
        return self._requests[request]

    def _answers(self, message: BaseMessage) -> Iterator[Packet]:
        request = getattr(message, "request", 0)
        match message:
            case messages.Press(capture_id=capture_id):
                self.presses.append(message)
                if self.refuse:
                    yield Packet(messages.PressRefused(
                        request=request, capture_id=capture_id, reason=self.refuse_reason,
                        message=self.refuse, hint=self.hint))
                else:
                    yield Packet(messages.PressAccepted(request=request, capture_id=capture_id))
            case messages.GetStatus():
                yield Packet(self.status(request))
            case messages.GetFace(capture_id=capture_id):
                found = [one for one in self.outcomes if one.message.capture_id == capture_id]
                yield _again(found[0], request) if found else Packet(messages.CaptureUnknown(
                    request=request, capture_id=capture_id))
            case messages.GetFrame(capture_id=capture_id):
                header, arrays = FrameHeader.of(small_frame())
                yield Packet(messages.FrameKept(
                    request=request, capture_id=capture_id, frame=header), arrays
                    ) if capture_id in self.frames else Packet(messages.CaptureUnknown(
                        request=request, capture_id=capture_id))
            case messages.ListCaptures(last=last):
                yield Packet(messages.CaptureList(request=request, captures=[
                    CaptureSummary(capture_id=one, state="done", accepted_at="then", attempts=1)
                    for one in "cba"[-last:]]))
            case messages.ListDead(after=after):
                letters = [] if after else [DeadLetter(
                    sequence=1, capture_id="dead", error="E", message="m", attempts=3,
                    accepted_at="then", finished_at="now")]
                yield Packet(messages.DeadLetters(request=request, letters=letters))
            case messages.RetryDead() | messages.DropDead():
                yield Packet(messages.CaptureUnknown(
                    request=request, capture_id=message.capture_id))
            case messages.RestartSensor(sensor=sensor):
                yield Packet(messages.SensorRestarting(request=request, sensor=sensor))
            case messages.Purge() | messages.Withdraw():
                removed, left = self.removals.pop(0) if self.removals else (0, True)
                yield Packet(messages.Removed(request=request, removed=removed, left=left))
            case messages.GetNext(after=after):
                if after < len(self.outcomes):
                    yield _again(self.outcomes[after], request)
                else:
                    yield Packet(messages.NothingNewer(
                        request=request, epoch="0f", sequence=len(self.outcomes)))


def _again(packet: Packet, request: int) -> Packet:
    return Packet(packet.message.model_copy(update={"request": request}), packet.arrays)


@contextmanager
def fake_hub() -> Iterator[FakeHub]:
    with tempfile.TemporaryDirectory(prefix="df-") as folder:
        hub = FakeHub(f"ipc://{folder}/hub")
        try:
            yield hub
        finally:
            hub.close()
