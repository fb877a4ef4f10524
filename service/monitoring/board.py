"""What the hub's loop shows to the thread that answers scrapes: one whole picture at a time."""

from dataclasses import dataclass, field

from denseface.service.monitoring.latencies import Histogram
from denseface.service.protocol.messages import Status

__all__ = ["Board", "Picture"]


@dataclass(frozen=True)
class Picture:
    """The hub at one moment, its last heartbeat; nothing in it changes any more."""

    taken: float
    """Seconds of `time.monotonic`."""
    status: Status
    counts: tuple[tuple[str, str, int], ...]
    """Name, label, number."""
    stages: dict[str, Histogram]
    subscriptions: dict[str, int] = field(default_factory=dict)
    """By topic."""


class Board:
    """Written by the hub's loop, read by others; the picture is replaced as a whole."""

    def __init__(self) -> None:
        self.picture: Picture | None = None
