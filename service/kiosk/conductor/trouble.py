"""What the hub's status says that a visitor has to know."""

from denseface.service.kiosk.page_messages import Trouble
from denseface.service.kiosk.visit.events import ServiceIs
from denseface.service.protocol.messages import Status

__all__ = ["GONE", "service_is"]

GONE = ServiceIs(Trouble.HUB)
"""The hub says nothing."""
_STREAMS = ("streaming", "warming")
"""States of a sensor that has pictures, or is about to."""


def service_is(status: Status, sensor: str | None) -> ServiceIs:
    """Read the worst of it; `sensor` is the one above the screen, None for any."""
    return ServiceIs(_trouble(status, sensor), status.retention_s)


def _trouble(status: Status, sensor: str | None) -> Trouble | None:
    if status.state != "serving":
        return Trouble.HUB
    if status.obstacle == "disk":
        return Trouble.DISK
    streams = status.has_frames if sensor is None else any(
        one.name == sensor and one.state in _STREAMS for one in status.sensor_states)
    if not streams:
        return Trouble.SENSOR
    # A queue that is full is a worker that does not keep up.
    return Trouble.WORKER if status.obstacle or not status.workers else None
