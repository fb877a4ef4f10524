"""How the kiosk does: how long a visitor waits for the first mesh, and what became of visits."""

import math
from collections import Counter, deque
from dataclasses import dataclass, field
from statistics import quantiles

__all__ = ["Figures"]

_KEPT = 1000
"""Newest captures of which the times are kept."""


@dataclass
class Figures:
    """Counts since the start, and times; nothing of a person."""

    exposure_to_drawn_ms: deque[float] = field(default_factory=lambda: deque(maxlen=_KEPT))
    """From the middle of a frame's exposure to the first mesh on the screen."""
    pages: Counter[str] = field(default_factory=Counter)
    """How pages came and went: `opened`, `turned_away`."""
    _exposed_s: dict[str, float] = field(default_factory=dict)
    """By capture, of those not drawn yet."""

    def exposed(self, capture_id: str, at_s: float) -> None:
        """Note when the frame of a face was exposed that is now sent; seconds, monotonic."""
        self._exposed_s = {capture_id: at_s}

    def drawn(self, capture_id: str, now_s: float) -> float | None:
        """Note that a face is on the screen; gives the milliseconds, at the first time."""
        exposed_s = self._exposed_s.pop(capture_id, None)
        if exposed_s is None:
            return None
        waited_ms = max((now_s - exposed_s) * 1e3, 0.0)
        self.exposure_to_drawn_ms.append(waited_ms)
        return waited_ms

    def as_dict(self) -> dict[str, object]:
        """Give all figures for the operator's page."""
        times = sorted(self.exposure_to_drawn_ms)
        found: dict[str, object] = {"pages": dict(self.pages), "drawn": len(times)}
        if times:
            found["exposure_to_drawn_p50_ms"] = round(times[len(times) // 2])
            found["exposure_to_drawn_p99_ms"] = round(
                quantiles(times, n=100)[-1] if len(times) > 1 else times[-1])
            found["exposure_to_drawn_max_ms"] = math.ceil(times[-1])
        return found
