"""What subscribers get: outcomes, previews and hints."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from denseface.missing import explained
from denseface.recon.face import Face
from denseface.service.errors import CaptureFailedError, RemoteProtocolError
from denseface.service.protocol.messages import CaptureFailed, FaceDone, Hint, Hints, Preview
from denseface.service.protocol.wire import Packet
from denseface.short_repr import short_repr


@dataclass(frozen=True, repr=False)
class PublishedFace:
    """A finished capture.

    Attributes
    ----------
    epoch : one life of the hub's database; another one counts anew
    sequence : number of the outcome within it
    capture_id : the capture
    face : its face
    """

    epoch: str
    sequence: int
    capture_id: str
    face: Face

    def __repr__(self) -> str:
        return short_repr(self, f"number {self.sequence}", self.capture_id,
                          f"{len(self.face.dense):,} dense points",
                          self.face.report.sensor or self.face.report.source,
                          self.face.report.captured_at)


@dataclass(frozen=True, repr=False)
class PublishedFailure:
    """A capture that ended without a face.

    Attributes
    ----------
    epoch, sequence, capture_id : as of `PublishedFace`
    error : why; not raised
    """

    epoch: str
    sequence: int
    capture_id: str
    error: CaptureFailedError

    def __repr__(self) -> str:
        return short_repr(self, f"number {self.sequence}", self.capture_id, self.error.error,
                          "given up" if self.error.dead else "")


Published = PublishedFace | PublishedFailure


@dataclass(frozen=True, repr=False)
class PublishedHint:
    """What a person in front of a sensor could do better.

    Attributes
    ----------
    sensor : its name
    timestamp_us : of the frame, sensor clock, microseconds
    codes : what is wrong with the frame, the most important first; empty where nothing is
    text : the first of them in words, "come closer"
    measures : what was measured, by name; the name ends with the unit
    """

    sensor: str
    timestamp_us: int
    codes: tuple[str, ...]
    text: str
    measures: Mapping[str, float]

    def __repr__(self) -> str:
        return short_repr(self, self.sensor, self.text or "ready", *self.codes)

    @property
    def ok(self) -> bool:
        """Nothing is wrong: a press now is worth it."""
        return not self.codes


@dataclass(frozen=True, eq=False, repr=False)
class PublishedPreview:
    """A small picture of what a sensor sees.

    Attributes
    ----------
    epoch, sequence : count what this run of the hub published; a number that is missing was not
        delivered
    timestamp_us : sensor clock, microseconds
    sensor : its name
    size : width and height, pixels, none above 640
    jpeg : the picture as a JPEG file; None where the sensor sent pixels
    hint : of the same frame or, where judging takes long, of one up to 2 s before, given once; None
        where none is new
    """

    epoch: str
    sequence: int
    timestamp_us: int
    sensor: str
    size: tuple[int, int]
    jpeg: bytes | None
    hint: PublishedHint | None
    _pixels: NDArray[np.uint8] | None

    def __repr__(self) -> str:
        width, height = self.size
        return short_repr(self, f"number {self.sequence}", self.sensor, f"{width}x{height}",
                          self.hint.text or "ready" if self.hint else "")

    @cached_property
    def image(self) -> NDArray[np.uint8]:
        """The picture, (h, w, 3) uint8, RGB, read-only; a JPEG is decoded when first asked for.

        Raises
        ------
        RemoteProtocolError
            Where the JPEG is damaged.
        MissingPackageError
            It takes OpenCV to decode one, which a client alone need not have; `jpeg` is the file.
        """
        if self._pixels is not None:
            return self._pixels
        with explained():
            import cv2

        flags = cv2.IMREAD_COLOR | cv2.IMREAD_IGNORE_ORIENTATION
        image = cv2.imdecode(np.frombuffer(self.jpeg or b"", np.uint8), flags)
        if image is None or image.shape != (self.size[1], self.size[0], 3):
            raise RemoteProtocolError(f"preview {self.sequence}: the JPEG cannot be decoded")
        decoded = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), np.uint8)
        decoded.flags.writeable = False
        return decoded


def outcome_of(packet: Packet) -> Published:
    """Read `FaceDone` or `CaptureFailed`; RemoteProtocolError for another, or a malformed face."""
    match packet.message:
        case FaceDone(epoch=epoch, sequence=sequence, capture_id=capture_id, face=header):
            return PublishedFace(epoch, sequence, capture_id, header.join(packet.arrays))
        case CaptureFailed(epoch=epoch, sequence=sequence, capture_id=capture_id) as failed:
            return PublishedFailure(epoch, sequence, capture_id, CaptureFailedError(
                capture_id, failed.error, failed.message, dead=failed.dead))
        case other:
            raise RemoteProtocolError(f"the hub answered with {other.kind}, an outcome expected")


def preview_of(packet: Packet, sensor: str | None) -> PublishedPreview | None:
    """Read a `Preview` of a sensor, of any where None; None where it is none or malformed."""
    message = packet.message
    if not isinstance(message, Preview) or sensor not in (None, message.preview.sensor):
        return None
    header = message.preview
    try:
        header.check(packet.arrays)
    except RemoteProtocolError:
        return None
    jpeg = packet.arrays["jpeg"].tobytes() if header.encoding == "jpeg" else None
    hint = _hint(header.sensor, header.hint) if header.hint else None
    return PublishedPreview(
        message.epoch, message.sequence, header.timestamp_us, header.sensor,
        (header.width, header.height), jpeg, hint, packet.arrays.get("image"))


def hint_of(packet: Packet, sensor: str | None) -> PublishedHint | None:
    """Read `Hints` of a sensor, of any where None; None where it is something else."""
    message = packet.message
    if not isinstance(message, Hints) or sensor not in (None, message.sensor):
        return None
    return _hint(message.sensor, message.hint)


def _hint(sensor: str, hint: Hint) -> PublishedHint:
    return PublishedHint(sensor, hint.timestamp_us, hint.codes, hint.text, hint.measures)
