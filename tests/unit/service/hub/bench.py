"""A hub on a bench: what peers say goes in, what the hub sends comes out."""

from dataclasses import dataclass, field

from denseface.recon.settings import Settings
from denseface.service.hub import Hub, settings_hash
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.outgoing import Output, Publish, Send
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.security.permissions import ALL_ROLES
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderStore
from tests.unit.service.faces import small_face, small_frame

__all__ = ["CLIENT", "FACE", "FACE_ARRAYS", "FRAME", "FRAME_ARRAYS", "HASH", "OTHER", "SENSOR",
           "SETTINGS", "WORKER", "Bench", "kinds", "restarted"]

SENSOR, CLIENT, WORKER, OTHER = b"sensor", b"client", b"worker", b"other"
HASH = settings_hash(Settings())
FRAME, FRAME_ARRAYS = FrameHeader.of(small_frame())
FACE, FACE_ARRAYS = FaceHeader.of(small_face())
SETTINGS = ServiceSettings(address="ipc:///unused", attempts=2, queue=3, reserve_mib=0)


@dataclass
class Bench:
    """A hub, a clock, and what came out."""

    hub: Hub
    store: FolderStore
    now: float = 100.0
    published: list[BaseMessage] = field(default_factory=list)

    def say(
        self, peer: bytes, message, arrays=None, key: str = "", roles=ALL_ROLES
    ) -> list[tuple[bytes, BaseMessage]]:
        return self._sent(self.hub.receive(
            self.now, peer, Packet(message, arrays or {}), key, roles))

    def wait(self, seconds: float) -> list[tuple[bytes, BaseMessage]]:
        self.now += seconds
        return self._sent(self.hub.tick(self.now))

    def _sent(self, outputs: list[Output]) -> list[tuple[bytes, BaseMessage]]:
        self.published += [one.packet.message for one in outputs
                           if isinstance(one, Publish) and one.topic is Topic.FACES]
        return [(one.peer, one.packet.message) for one in outputs if isinstance(one, Send)]

    def sensor(self) -> None:
        assert self.say(SENSOR, messages.SensorReady(name="s", source="x.oni")) == []

    def worker(self, peer: bytes = WORKER, credit: int = 0):
        return self.say(peer, messages.WorkerReady(name=peer.decode(), credit=credit))

    def press(
        self, capture_id: str = "a", request: int = 7, peer: bytes = CLIENT, key: str = ""
    ):
        return self.say(peer, messages.Press(request=request, capture_id=capture_id), key=key)

    def frame(self, capture_id: str = "a"):
        return self.say(SENSOR, messages.Frame(capture_id=capture_id, frame=FRAME), FRAME_ARRAYS)

    def checksum(self, capture_id: str) -> str:
        """Of the frame that is kept now."""
        stored = self.store.find(capture_id)
        return stored.frame_sha256 if stored else "0" * 64

    def result(self, capture_id: str = "a", peer: bytes = WORKER, hashed: str = HASH,
               frame_sha256: str | None = None, arrays=FACE_ARRAYS):
        return self.say(peer, messages.Result(
            capture_id=capture_id, settings_hash=hashed, face=FACE,
            frame_sha256=frame_sha256 or self.checksum(capture_id)), arrays)

    def fail_job(self, peer: bytes = WORKER, capture_id: str = "a", *, final: bool = False):
        return self.say(peer, messages.JobFailed(
            capture_id=capture_id, settings_hash=HASH, frame_sha256=self.checksum(capture_id),
            error="Error", message="why", final=final))

    def accepted(self, *capture_ids: str) -> None:
        self.sensor()
        for capture_id in capture_ids:
            self.press(capture_id)
            self.frame(capture_id)


def restarted(bench: Bench) -> Bench:
    """Another hub on the same store."""
    return Bench(Hub(bench.store, SETTINGS, Settings()), bench.store, bench.now)


def kinds(sent) -> list[tuple[bytes, str]]:
    return [(peer, message.kind) for peer, message in sent]
