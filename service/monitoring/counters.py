"""What happened how often, for `denseface status` and the metrics."""

from collections import Counter

__all__ = ["Counters"]


class Counters:
    """Plain numbers by name and label, all of one process, from zero at its start."""

    def __init__(self) -> None:
        self._counts: Counter[tuple[str, str]] = Counter()

    def add(self, name: str, label: str = "", by: int = 1) -> None:
        """Count something that happened; names and labels come from a fixed set."""
        self._counts[name, label] += by

    def labels(self, name: str) -> dict[str, int]:
        """Give the counts of one name by label, in order of the labels."""
        return {label: count for (known, label), count in sorted(self._counts.items())
                if known == name}

    def items(self) -> list[tuple[str, str, int]]:
        """Give name, label and count of all, sorted."""
        return [(name, label, count) for (name, label), count in sorted(self._counts.items())]
