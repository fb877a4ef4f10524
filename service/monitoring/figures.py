"""What the hub's process measures: counts, times, sizes."""

from bisect import bisect_left
from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

from denseface.service.protocol.status import Restarts

__all__ = ["BUCKETS_S", "Counters", "Figures", "Histogram", "Latencies"]

BUCKETS_S = (0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5, 5.0, 10.0, 30.0,
             60.0)
"""Upper ends of the histograms' buckets, seconds; one more has no upper end."""
_MAX_STAGES = 32
"""Stages that are told apart: some names come from workers."""


class Counters:
    """Numbers by name and label, since the start of the process."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, name: str, label: str = "", by: int = 1) -> None:
        """Add to a counter; names and labels come from a fixed set."""
        self._counts[name, label] += by

    def by_label(self, name: str) -> dict[str, int]:
        """Give the counts of one name by label, sorted."""
        return {label: count for (known, label), count in sorted(self._counts.items())
                if known == name}

    def items(self) -> list[tuple[str, str, int]]:
        """Give name, label and count of all, sorted."""
        return [(name, label, count) for (name, label), count in sorted(self._counts.items())]


@dataclass
class Histogram:
    """Times of one stage."""

    counts: list[int] = field(default_factory=lambda: [0] * (len(BUCKETS_S) + 1))
    """Times in each bucket, not cumulative."""
    total_s: float = 0.0

    @property
    def count(self) -> int:
        """Number of times."""
        return sum(self.counts)

    def add(self, seconds: float) -> None:
        """Add one."""
        self.counts[bisect_left(BUCKETS_S, seconds)] += 1
        self.total_s += seconds

    def quantile_s(self, fraction: float) -> float:
        """Give a quantile, seconds: linear within a bucket, 0 where there are no times.

        In the bucket without an upper end it is that bucket's lower end.
        """
        wanted = fraction * self.count
        below = 0
        for number, (low, high) in zip(self.counts, pairwise((0.0, *BUCKETS_S)), strict=False):
            if number and below + number >= wanted:
                return low + (high - low) * (wanted - below) / number
            below += number
        return BUCKETS_S[-1] if below < self.count else 0.0


class Latencies:
    """Histograms by stage, since the start of the process."""

    def __init__(self) -> None:
        self._stages: dict[str, Histogram] = {}

    def observe(self, stage: str, seconds: float) -> None:
        """Add a time; negative ones, and those of more stages than the limit, are left out."""
        if seconds < 0 or (stage not in self._stages and len(self._stages) >= _MAX_STAGES):
            return
        self._stages.setdefault(stage, Histogram()).add(seconds)

    def stages(self) -> dict[str, Histogram]:
        """Give a copy of all, in the order in which they first occurred."""
        return {stage: Histogram(list(one.counts), one.total_s)
                for stage, one in self._stages.items()}


class Figures:
    """One for each hub; everything that counts or measures adds to it."""

    def __init__(self) -> None:
        self.counters = Counters()
        self.latencies = Latencies()
        self.kept_bytes: int | None = None
        """Size of the data folder's files when last measured; None before."""
        self.log_lines_lost = 0
        """Lines of this process's log that could not be written."""
        self.restarts: dict[str, Restarts] = {}
        """By process, as the supervisor counts them."""
