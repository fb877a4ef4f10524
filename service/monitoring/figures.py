"""What the hub's process knows of itself: counts, times, sizes."""

from denseface.service.monitoring.counters import Counters
from denseface.service.monitoring.latencies import Latencies

__all__ = ["Figures"]


class Figures:
    """One for each hub; everything that counts or measures adds to it."""

    def __init__(self) -> None:
        self.counters = Counters()
        self.latencies = Latencies()
        self.kept_bytes: int | None = None
        """Size of the data folder's files when it was last measured."""
