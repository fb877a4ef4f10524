"""What the hub's status says that a visitor has to know."""

from denseface.service.kiosk.page_messages import Trouble
from denseface.service.kiosk.visit.events import ServiceIs
from denseface.service.protocol.messages import Status

__all__ = ["GONE", "service_is"]

GONE = ServiceIs(Trouble.HUB)
"""The hub says nothing."""
_STREAMS = ("streaming", "warming")
"""States of a sensor that has pictures, or is about to."""


def service_is(status: Status, sensor: str | None, reserve_bytes: int) -> ServiceIs:
    """Read the worst of it.

    Parameters
    ----------
    sensor : the one above the screen; None for any
    reserve_bytes : room of the disk below which the hub takes no press
    """
    return ServiceIs(_trouble(status, sensor, reserve_bytes),
                     getattr(status, "retention_s", 86400.0))


def _trouble(status: Status, sensor: str | None, reserve_bytes: int) -> Trouble | None:
    if status.state != "serving":
        return Trouble.HUB
    if status.free_bytes is not None and status.free_bytes < reserve_bytes:
        return Trouble.DISK
    streams = status.has_frames if sensor is None else any(
        one.name == sensor and one.state in _STREAMS for one in status.sensor_states)
    if not streams:
        return Trouble.SENSOR
    return None if status.workers else Trouble.WORKER
