"""The test vectors of `docs/vectors`: each kind of message as JSON and as the bytes of its parts.

`script/vectors` writes them anew from the code; `docs/wire.md` says what is in them.
"""

import base64
import json
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Union

import numpy as np
from pydantic import Field, TypeAdapter

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.recon.face import Consent, DenseCloud, Face, PointCloud, Report
from denseface.recon.settings import Settings
from denseface.service.export.face_grid import encode_face_grid
from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.message_base import BaseMessage, CaptureSummary, DeadLetter
from denseface.service.protocol.packing import pack, unpack
from denseface.service.protocol.payload import Arrays, FaceHeader, FrameHeader, PreviewHeader
from denseface.service.protocol.sensor_messages import SensorFigures
from denseface.service.protocol.status import Restarts, SensorStatus
from denseface.service.protocol.wire import Packet, encode
from tests.face_grid_reader import read_face_grid

__all__ = ["FOLDER", "Vector", "face", "files", "vectors"]

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "vectors"

_ID = "visit-17"
_EPOCH = "9f86d081884c7d65"
_DIGEST = "9f86d081884c7d659a2feaa0c55ad015a3bf4f1b2b0b822cd15d6c15b0f00a08"
_AT = "2026-01-31T14:30:00Z"
_JPEG = base64.b64decode(
    "/9j/4AAQSkZJRgABAQAAAQABAAD/2wBDAA0JCgsKCA0LCgsODg0PEyAVExISEyccHhcgLikxMC4pLSwzOko+MzZGNywt"
    "QFdBRkxOUlNSMj5aYVpQYEpRUk//wAALCAAIABABAREA/8QAFQABAQAAAAAAAAAAAAAAAAAABQb/xAAWEAADAAAAAAAA"
    "AAAAAAAAAAAABUL/2gAIAQEAAD8ADTyXaeT/2Q==")
"""A grey picture of 16 x 8 pixels."""


@dataclass(frozen=True)
class Vector:
    """One message; `name` is its kind, and after a dot what is special about it."""

    name: str
    sender: str
    packet: Packet
    topic: str = ""
    decoded: Mapping[str, Any] | None = None

    @property
    def parts(self) -> list[bytes]:
        """As they travel: before the header the topic, where it is published."""
        topic = [self.topic.encode()] if self.topic else []
        return [*topic, *map(bytes, encode(self.packet))]

    def json(self) -> str:
        """Give what the parts say, for readers and for tests."""
        parts = self.parts
        tree = {
            "from": self.sender, "topic": self.topic or None,
            "parts": [len(part) for part in parts],
            "header": json.loads(parts[bool(self.topic)]),
            "arrays": {name: array.tolist() for name, array in self.packet.arrays.items()}}
        return _written(tree | ({"decoded": self.decoded} if self.decoded else {}))


def files() -> Iterator[tuple[str, bytes]]:
    """Give the name and the contents of each file of `FOLDER`."""
    for one in vectors():
        yield f"{one.name}.json", one.json().encode()
        yield f"{one.name}.bin", b"".join(one.parts)
    grid = encode_face_grid(face())
    read = read_face_grid(grid)
    yield "face_grid.bin", grid
    yield "face_grid.json", _written({"header": read.header, "decoded": {
        "initial": {"points": read.seeds.round(2).tolist(), "colors": read.seed_colors.tolist()},
        "dense": {"cells": read.cells.tolist(), "points": read.points.round(4).tolist(),
                  "colors": read.colors.tolist(),
                  "sigma": [float(f"{one:.6g}") for one in read.sigma]}}}).encode()
    kinds = (*messages.TO_HUB, *messages.FROM_HUB)
    union: Any = Annotated[Union[tuple(kinds)], Field(discriminator="kind")]  # noqa: UP007
    yield "schema.json", (json.dumps(TypeAdapter(union).json_schema(), indent=1) + "\n").encode()


def face() -> Face:
    """A face of 21 points on a grid of 4 x 11, whose rows end within a byte, with holes."""
    rows, columns, step = 4, 11, 0.9375
    on = np.array([[0, 0, 1, 1, 1, 0, 0, 0, 0, 0, 0], [0, 1, 1, 1, 1, 1, 0, 0, 1, 1, 1],
                   [0, 1, 1, 0, 1, 1, 0, 0, 0, 1, 0], [0, 0, 1, 1, 1, 0, 0, 0, 1, 0, 1]])
    cells = np.argwhere(on).astype(np.int32)
    row, column = cells.T
    points = np.stack([-4.5 + step * column, 100.25 + step * row,
                       700 + 0.01 * (column - 3) ** 2 + 0.3 * row], axis=1).astype(np.float32)
    normals = np.stack([0.11 * (column - 5), 0.2 * (row - 1), -np.ones(len(row))], axis=1)
    normals[0] = 1, 0, 0  # as far from the camera's axis as there is
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sigma = np.geomspace(1e-4, 6e4, len(row)).astype(np.float32)
    colors = np.stack([23 * column, 60 * row, 255 - 20 * column], axis=1).astype(np.uint8)
    report = Report(
        capture_id=_ID, face_box=(200, 120, 180, 180), candidates=(), initial_points=3,
        dense_points=len(row), mean_spacing_mm=1.875, r0_mm=10.5, noise_mm=0.75,
        timings_ms={"total": 412.0}, settings=Settings(), calibration="unspecified", skew_us=-1000,
        captured_at=_AT, sensor="usb 1-2", source="openni2:1203", version="0.1.0")
    dense = DenseCloud(points, colors, normals.astype(np.float32), sigma, cells, (rows, columns),
                       step)
    return Face(PointCloud(points[::8].copy(), colors[::8].copy()), dense, report)


def _sent(given: Face) -> Face:
    """Give the face that a reader gets: of normals and sigma as much as is sent."""
    return replace(given, dense=unpack(pack(given.dense)))


def _clouds(given: Face) -> dict[str, Any]:
    dense = given.dense
    return {
        "initial": {"points": given.initial.points.tolist(),
                    "colors": given.initial.colors.tolist()},
        "dense": {"cells": dense.cells.tolist(), "points": dense.points.tolist(),
                  "colors": dense.colors.tolist(), "normals": dense.normals.tolist(),
                  "sigma": dense.sigma.tolist()}}


def _frame(**more: Any) -> tuple[FrameHeader, Arrays]:
    """A frame of 4 x 3 pixels of depth and 5 x 4 of colour."""
    depth = CameraModel(width=4, height=3, fx=3.5, fy=3.5, cx=1.5, cy=1.0)
    color = CameraModel(width=5, height=4, fx=4.25, fy=4.25, cx=2.0, cy=1.5)
    has_color = more.get("has_color", True)
    header = FrameHeader(
        calibration=Calibration(depth=depth, color=color if has_color else depth,
                                depth_to_color=DepthToColor(translation_mm=(-25.0, 0.0, 0.0))),
        depth_timestamp_us=1_000_000, color_timestamp_us=1_001_000, **more)
    arrays: dict[str, Any] = {
        "depth": np.arange(700, 712, dtype=np.uint16).reshape(3, 4)}
    arrays["depth"][1, 2] = 0
    if has_color:
        arrays["color"] = np.arange(60, dtype=np.uint8).reshape(4, 5, 3)
    return header, arrays


def vectors() -> Iterator[Vector]:
    """Give a message of every kind, of some several."""
    yield from _of_clients()
    yield from _of_the_hub_to_clients()
    yield from _of_sensors_and_workers()


def _of_clients() -> Iterator[Vector]:
    def said(message: BaseMessage, special: str = "") -> Vector:
        return Vector(_name(message, special), "client", Packet(message))

    when = datetime(2026, 1, 31, 14, 30, tzinfo=UTC)
    yield said(messages.Press(request=7, capture_id=_ID))
    yield said(messages.Press(
        request=8, capture_id=_ID, sensor="attic", gate="best", gate_timeout=5.0, frames=4,
        consent=Consent(text_version="v3", language="de-CH", retention_s=3600.0, at=when)), "full")
    yield said(messages.Withdraw(request=9, capture_id=_ID))
    yield said(messages.GetFace(request=10, capture_id=_ID, wait_s=20.0))
    yield said(messages.GetFrame(request=11, capture_id=_ID))
    yield said(messages.GetNext(request=12, after=41))
    yield said(messages.FindStart(request=13, last=10))
    yield said(messages.FindStart(request=14, since=when), "since")
    yield said(messages.GetStatus(request=15))
    yield said(messages.ListCaptures(request=16, last=2))
    yield said(messages.ListDead(request=17, after=3))
    yield said(messages.RetryDead(request=18, capture_id=_ID))
    yield said(messages.DropDead(request=19, capture_id=_ID))
    yield said(messages.Purge(request=20, capture_id=_ID))
    yield said(messages.Purge(request=21, before=when), "before")
    yield said(messages.Purge(request=22, everything=True), "everything")
    yield said(messages.RestartSensor(request=23, sensor="attic"))


def _of_the_hub_to_clients() -> Iterator[Vector]:
    def said(message: BaseMessage, special: str = "", topic: str = "", arrays: Arrays | None = None,
             decoded: Mapping[str, Any] | None = None) -> Vector:
        return Vector(_name(message, special), "hub", Packet(message, arrays or {}), topic, decoded)

    header, arrays = FaceHeader.of(face())
    decoded = _clouds(_sent(face()))
    done = {"epoch": _EPOCH, "sequence": 42, "capture_id": _ID}
    hint = Hint(timestamp_us=1_000_000, codes=("too_far",), text="come closer",
                measures={"distance_mm": 1400.0})
    yield said(messages.PressAccepted(request=7, capture_id=_ID))
    yield said(messages.PressRefused(request=7, capture_id=_ID, reason="no_sensor",
                                     message="no sensor is connected"))
    yield said(messages.PressRefused(request=8, capture_id=_ID, reason="quality", hint=hint,
                                     message="no frame was good enough"), "hint")
    yield said(messages.CapturePending(request=10, capture_id=_ID))
    yield said(messages.CaptureUnknown(request=10, capture_id=_ID))
    yield said(messages.RequestFailed(
        request=12, message="refused: get_next.after: expected at least 0, found -1"))
    yield said(messages.NothingNewer(request=12, epoch=_EPOCH, sequence=42))
    yield said(messages.StartAt(request=13, epoch=_EPOCH, sequence=32))
    yield said(messages.FaceDone(**done, face=header), "", "faces", arrays, decoded)
    yield said(messages.FaceDone(request=12, **done, face=header), "answer", "", arrays, decoded)
    failed = {"error": "NoFaceError", "message": "no face in the picture", "dead": False}
    yield said(messages.CaptureFailed(**done, **failed), "", "faces")
    yield said(messages.CaptureFailed(request=10, **done, **failed), "answer")
    kept, images = _frame(sensor="usb 1-2", captured_at=_AT, source="openni2:1203",
                          exposed_after_press_ms=33.5, exposure_known_by="stamps",
                          skew_known_by="stamps", fused=4, notes=("the sun is in the picture",))
    yield said(messages.FrameKept(request=11, capture_id=_ID, frame=kept), arrays=images)
    yield said(_status(15))
    yield said(_status(0), "published", "status")
    yield said(messages.Status(
        request=15, epoch="0", sequence=0, hub_version="0.1.0", sensors=(), workers=(), pressed=0,
        queued=0, working=0, done=0, failed=0, dead=0, state="opening"), "opening")
    picture, pixels = PreviewHeader.of_jpeg(_JPEG, 1_001_000, hint)
    yield said(messages.Preview(epoch=_EPOCH, sequence=5, preview=picture.model_copy(
        update={"sensor": "attic"})), "", "preview", pixels)
    yield said(messages.Preview(epoch=_EPOCH, sequence=6, preview=PreviewHeader(
        width=3, height=2, timestamp_us=1_001_000, sensor="attic")), "rgb", "preview",
        {"image": np.arange(18, dtype=np.uint8).reshape(2, 3, 3)})
    yield said(messages.Hints(sensor="attic", hint=hint), "", "hints")
    yield said(messages.DeadLetters(request=17, letters=(DeadLetter(
        sequence=4, capture_id=_ID, error="WorkerLost", message="no worker answered", attempts=3,
        accepted_at=_AT, finished_at=_AT),)))
    yield said(messages.CaptureList(request=16, captures=(
        CaptureSummary(capture_id="visit-18", state="queued", accepted_at=_AT, attempts=0),
        CaptureSummary(capture_id=_ID, state="done", accepted_at=_AT, attempts=1, finished_at=_AT,
                       sequence=42))))
    yield said(messages.SensorRestarting(request=23, sensor="attic"))
    yield said(messages.Removed(request=9, removed=1, left=False))


def _status(request: int) -> messages.Status:
    return messages.Status(
        request=request, epoch=_EPOCH, sequence=42, hub_version="0.1.0", sensors=("attic",),
        workers=("bench2/811",), pressed=0, queued=1, working=1, done=40, failed=2, dead=0,
        refused={"malformed": 1}, presses_refused={"no_sensor": 3}, since_start={"accepted": 44},
        latencies={"total": messages.Latency(count=40, median_s=0.5, p99_s=0.75)},
        restarts={"worker 1": Restarts(exited=1, last="SIGSEGV")}, free_bytes=10**11,
        kept_bytes=10**8, retention_s=86400.0, sensor_states=(SensorStatus(
            name="attic", state="streaming", identity="usb 1-2",
            figures=SensorFigures(frames=9000)),),
        compiling=(messages.Compiling(name="bench3/17", done=12, total=98),))


def _of_sensors_and_workers() -> Iterator[Vector]:
    def said(sender: str, message: BaseMessage, arrays: Arrays | None = None,
             special: str = "") -> Vector:
        return Vector(_name(message, special), sender, Packet(message, arrays or {}))

    frame, images = _frame()
    gray, depth = _frame(has_color=False, depth_unit_um=100, depth_rounding="none",
                         depth_max_mm=9000)
    done, arrays = FaceHeader.of(face())
    job = {"capture_id": _ID, "settings_hash": "0f3a", "frame_sha256": _DIGEST}
    hint = Hint(timestamp_us=1_000_000, measures={"distance_mm": 800.0})
    picture, pixels = PreviewHeader.of_jpeg(_JPEG, 1_001_000)
    yield said("sensor", messages.SensorReady(name="attic", source="openni2:"))
    yield said("sensor", messages.SensorState(
        name="attic", state="stalled", reason="no picture for 2 s", identity="usb 1-2",
        figures=SensorFigures(frames=9000, stalls=1)))
    yield said("sensor", messages.QualityHint(hint=hint))
    yield said("sensor", messages.Frame(capture_id=_ID, frame=frame), images)
    yield said("sensor", messages.Frame(capture_id=_ID, frame=gray), depth, "gray")
    yield said("sensor", messages.FrameFailed(capture_id=_ID, message="it was unplugged"))
    yield said("sensor", messages.PreviewFrame(preview=picture), pixels)
    yield said("worker", messages.WorkerReady(name="bench2/811", credit=3))
    yield said("worker", messages.Heartbeat(holding=_ID))
    yield said("worker", messages.Heartbeat(compiling=messages.Compiling(
        name="bench3/17", done=12, total=98)), special="compiling")
    yield said("worker", messages.Result(**job, face=done), arrays)
    yield said("worker", messages.JobFailed(
        **job, error="NoFaceError", message="no face in the picture", final=True))
    yield said("worker", messages.Goodbye())
    yield said("hub", messages.Announce())
    yield said("hub", messages.Denied(message="needs the role worker"))
    yield said("hub", messages.Take(capture_id=_ID))
    yield said("hub", messages.Take(capture_id=_ID, gate="best", gate_timeout=5.0, frames=4),
               special="full")
    yield said("hub", messages.TakePreview())
    yield said("hub", messages.TakeHints(seconds=3.0))
    yield said("hub", messages.Restart())
    yield said("hub", messages.FrameAccepted(capture_id=_ID))
    yield said("hub", messages.FrameRefused(capture_id=_ID, message="nobody waits for it"))
    yield said("hub", messages.Job(**job, frame=frame, attempt=1, settings=Settings()), images)


def _name(message: BaseMessage, special: str) -> str:
    return f"{message.kind}.{special}" if special else message.kind


def _written(tree: Any, indent: str = "") -> str:
    """Write JSON: objects over several lines, lists of plain values on one."""
    deeper = f"{indent} "
    if isinstance(tree, dict) and tree:
        inner = ",\n".join(f"{deeper}{json.dumps(name)}: {_written(value, deeper)}"
                           for name, value in tree.items())
        text = f"{{\n{inner}\n{indent}}}"
    else:
        text = json.dumps(tree, ensure_ascii=False)
    return text if indent else f"{text}\n"


def main() -> int:
    """Write all of them, and remove what is no longer one."""
    made = dict(files())
    FOLDER.mkdir(exist_ok=True)
    for path in FOLDER.iterdir():
        if path.name not in made:
            path.unlink()
    for name, content in made.items():
        (FOLDER / name).write_bytes(content)
    print(f"{len(made)} files in {FOLDER}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
