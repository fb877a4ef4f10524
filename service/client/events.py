"""What subscribers get: outcomes and previews."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.errors import CaptureFailedError, RemoteProtocolError
from denseface.service.protocol.messages import CaptureFailed, FaceDone, Preview
from denseface.service.protocol.wire import Packet


@dataclass(frozen=True)
class PublishedFace:
    """A finished capture."""

    epoch: str
    sequence: int
    capture_id: str
    face: Face


@dataclass(frozen=True)
class PublishedFailure:
    """A capture that ended without a face."""

    epoch: str
    sequence: int
    capture_id: str
    error: CaptureFailedError


Published = PublishedFace | PublishedFailure


@dataclass(frozen=True, eq=False)
class PublishedPreview:
    """A small picture of what the sensor sees.

    Attributes
    ----------
    epoch, sequence : count what this run of the hub published; a number that is missing was not
        delivered
    timestamp_us : sensor clock, microseconds
    image : (h, w, 3) uint8, RGB, no side above 320; read-only
    """

    epoch: str
    sequence: int
    timestamp_us: int
    image: NDArray[np.uint8]


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


def preview_of(packet: Packet | None) -> PublishedPreview | None:
    """Read a `Preview`; None where it is something else or malformed."""
    if packet is None or not isinstance(packet.message, Preview):
        return None
    message = packet.message
    return PublishedPreview(message.epoch, message.sequence, message.preview.timestamp_us,
                            packet.arrays["image"])
