"""What one capture costs the hub's process, step by step, and its workers and sensor."""

import time
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

from denseface.capture import RgbdFrame
from denseface.recon import reconstruct
from denseface.recon.face import Face
from denseface.recon.settings import Settings
from denseface.service.client.events import outcome_of
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.wire import Buffer, Packet, decode_from_hub, decode_to_hub, encode
from denseface.service.runtime.files import write_synced
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderStore

__all__ = ["Laps", "one_capture_each"]

_SENSOR, _CLIENT, _WORKER = b"sensor", b"client", b"worker"
_T = TypeVar("_T")


@dataclass
class Laps:
    """Milliseconds by step, one for each capture, and bytes."""

    ms: dict[str, list[float]] = field(default_factory=dict)
    frame_bytes: int = 0
    face_bytes: int = 0
    points: int = 0

    def time(self, name: str, call: Callable[[], _T]) -> _T:
        """Call, and note how long it took."""
        start = time.perf_counter()
        result = call()
        self.ms.setdefault(name, []).append((time.perf_counter() - start) * 1e3)
        return result


def one_capture_each(folder: Path, frame: RgbdFrame, runs: int) -> Laps:
    """Pass a frame through a hub without sockets, again and again, by turns with the function."""
    laps = Laps()
    settings = ServiceSettings(address="ipc:///unused", data=folder)
    with FolderStore(folder / "data") as store:
        hub = Hub(store, settings, Settings())
        for run in range(runs):
            _capture(laps, hub, frame, f"bench-{run}", run)
            _steps(laps, folder, frame)
    return laps


def _say(hub: Hub, peer: bytes, parts: list[bytes]) -> tuple[list[Output], list[list[bytes]]]:
    """All that the hub's process does for a message, but its sockets."""
    outputs = hub.receive(time.monotonic(), peer, decode_to_hub(parts))
    return outputs, [encode(output.packet) for output in outputs]


def _capture(laps: Laps, hub: Hub, frame: RgbdFrame, capture_id: str, run: int) -> None:
    hub.tick(time.monotonic())
    for peer, hello in ((_SENSOR, messages.SensorReady(name="s", source="x")),
                        (_WORKER, messages.WorkerReady(name="w", credit=run)),
                        (_CLIENT, messages.Press(request=1, capture_id=capture_id))):
        hub.receive(time.monotonic(), peer, Packet(hello))
    header, arrays = FrameHeader.of(frame)
    parts = laps.time("sensor: encode frame", lambda: encode(
        Packet(messages.Frame(capture_id=capture_id, frame=header), arrays)))
    outputs, sent = laps.time("accept to dispatch", lambda: _say(hub, _SENSOR, parts))
    laps.frame_bytes = sum(map(len, parts))
    wires = next(wire for output, wire in zip(outputs, sent, strict=True)
                 if isinstance(output.packet.message, messages.Job))
    packet = laps.time("worker: decode job", lambda: decode_from_hub(wires))
    job = packet.message
    if not isinstance(job, messages.Job):
        raise TypeError(f"a job was expected, found {job.kind}")
    face = laps.time("reconstruct", lambda: reconstruct(
        job.frame.join(packet.arrays), job.settings))
    parts = laps.time("worker: pack result", lambda: _result(capture_id, job, face))
    outputs, sent = laps.time("result to publication", lambda: _say(hub, _WORKER, parts))
    laps.face_bytes, laps.points = sum(map(len, parts)), len(face.dense)
    kinds = [output.packet.message.kind for output in outputs]
    if kinds != ["face_done"]:
        raise RuntimeError(f"a face was to be published, found {kinds}")
    laps.time("client: unpack face", lambda: outcome_of(decode_from_hub(sent[0])))


def _result(capture_id: str, job: messages.Job, face: Face) -> list[Buffer]:
    header, clouds = FaceHeader.of(face)
    return encode(Packet(messages.Result(
        capture_id=capture_id, settings_hash=job.settings_hash, frame_sha256=job.frame_sha256,
        face=header), clouds))


def _steps(laps: Laps, folder: Path, frame: RgbdFrame) -> None:
    """The steps alone, on the same bytes."""
    for what, parts in _wires(frame):
        packet = laps.time(f"{what}: decode", lambda parts=parts: decode_to_hub(parts))
        laps.time(f"{what}: encode", lambda packet=packet: encode(packet))
        laps.time(f"{what}: checksum", lambda parts=parts: list(map(zlib.crc32, parts)))
        path = folder / f"{what}.tmp"
        laps.time(f"{what}: cached write",
                  lambda path=path, parts=parts: path.write_bytes(b"".join(parts)))
        laps.time(f"{what}: direct write and sync",
                  lambda path=path, parts=parts: write_synced(path, parts))
        laps.time(f"{what}: read", path.read_bytes)


def _wires(frame: RgbdFrame) -> Iterator[tuple[str, list[bytes]]]:
    header, arrays = FrameHeader.of(frame)
    yield "frame", encode(Packet(messages.Frame(capture_id="a", frame=header), arrays))
    found, clouds = FaceHeader.of(reconstruct(frame))
    yield "face", encode(Packet(messages.Result(
        capture_id="a", settings_hash="0f", frame_sha256="0" * 64, face=found), clouds))
