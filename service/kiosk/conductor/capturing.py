"""A press and its face: asks the hub, and says what came of it as events of a visit."""

import asyncio
import time
from collections.abc import Callable
from datetime import datetime

import structlog

from denseface.recon.face import Consent, Face
from denseface.service.errors import (
    CaptureFailedError,
    ClientTimeoutError,
    PressRefusedError,
    ServiceError,
    UnknownCaptureError,
)
from denseface.service.export.face_grid import encode_face_grid
from denseface.service.kiosk.conductor.measuring import measurements_of
from denseface.service.kiosk.conductor.ports import Hub
from denseface.service.kiosk.page_messages import Measurement
from denseface.service.kiosk.visit.effects import Consented, TakePicture
from denseface.service.kiosk.visit.events import (
    CaptureRefused,
    Event,
    FaceFailed,
    FrameTaken,
)
from denseface.service.protocol.hint import Hint

__all__ = ["ShownFace", "take_picture"]

_PRESS_S = 15.0
"""Longest wait for a frame, seconds; the visit gives up before."""
_FACE_S = 120.0
"""Longest wait for a face, seconds."""
_log = structlog.get_logger("kiosk")


class ShownFace:
    """A face as it is sent to a page.

    Attributes
    ----------
    face : as the hub gave it
    grid : the same for a browser
    measured : lengths on it; None where they are not asked for
    exposed_s : middle of its frame's exposure, monotonic clock, seconds
    """

    def __init__(self, face: Face, grid: bytes, exposed_s: float,
                 measured: tuple[Measurement, ...] | None = None) -> None:
        self.face, self.grid, self.exposed_s, self.measured = face, grid, exposed_s, measured


async def take_picture(
    hub: Hub, sensor: str | None, effect: TakePicture, happened: Callable[[Event], None],
    withdraw: Callable[[str], None], clock: Callable[[], float] = time.monotonic, *,
    measured: bool = False,
) -> ShownFace | None:
    """Press and wait for the face; what else comes of it is said by `happened`.

    Parameters
    ----------
    withdraw : removes a capture of which nobody knows whether there is one
    measured : whether lengths on the face are wanted
    """
    visit, capture_id = effect.visit, effect.capture_id
    pressed_s = clock()
    try:
        await hub.press(
            capture_id, timeout=_PRESS_S, sensor=sensor, gate="best",
            gate_timeout=effect.best_of_s, consent=_consent(effect.consent))
    except PressRefusedError as error:
        hint = Hint(timestamp_us=0, codes=error.codes, text=error.text, measures={})
        happened(CaptureRefused(visit, capture_id, error.reason, hint))
        return None
    except ServiceError as error:
        _log.warning("no picture", reason=str(error))
        withdraw(capture_id)
        happened(CaptureRefused(
            visit, capture_id, "timeout" if isinstance(error, TimeoutError) else "failed"))
        return None
    happened(FrameTaken(visit, capture_id))
    try:
        face = await hub.get(capture_id, timeout=_FACE_S)
        # Its five milliseconds are nobody's: the loop serves the mirror meanwhile.
        grid = await asyncio.to_thread(encode_face_grid, face)
        lengths = await asyncio.to_thread(measurements_of, face) if measured else None
    except (ServiceError, ValueError) as error:
        happened(FaceFailed(visit, capture_id, _name(error)))
        return None
    exposed_s = pressed_s + (face.report.exposed_after_press_ms or 0.0) / 1e3
    return ShownFace(face, grid, exposed_s, lengths)


def _name(error: Exception) -> str:
    if isinstance(error, CaptureFailedError):
        return error.error
    if not isinstance(error, UnknownCaptureError | ClientTimeoutError):
        _log.warning("no face", reason=str(error))
    return type(error).__name__


def _consent(consented: Consented | None) -> Consent | None:
    return None if consented is None else Consent(
        text_version=consented.text_version, language=consented.language,
        retention_s=consented.retention_s, at=datetime.fromisoformat(consented.at))
