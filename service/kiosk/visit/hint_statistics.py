"""Why people wait, and what becomes of visits: counts alone, nothing of a person."""

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from enum import StrEnum

__all__ = ["GOOD", "HintStatistics", "VisitEnd"]

GOOD = "good"
"""Stands for a code where nothing is wrong."""
_LONGEST_S = 1.0
"""Between two samples, seconds: what is longer was no wait for the reason of the first."""


class VisitEnd(StrEnum):
    """How a visit ended."""

    DONE = "done"
    DECLINED = "declined"
    """The consent was refused."""
    CANCELLED = "cancelled"
    LEFT = "left"
    """Nobody touched anything any more."""
    DELETED = "deleted"
    PAGE_GONE = "page_gone"


@dataclass
class HintStatistics:
    """Since the kiosk was started."""

    seconds: defaultdict[str, float] = field(default_factory=lambda: defaultdict(float))
    """While people looked for their place, by the gate's code; `GOOD` where nothing was wrong."""
    visits: int = 0
    captures: int = 0
    """Pictures asked of the sensor."""
    faces: int = 0
    kept: int = 0
    """Faces for which links were made."""
    ends: Counter[VisitEnd] = field(default_factory=Counter)
    failures: Counter[str] = field(default_factory=Counter)
    """Pictures without a face, by `FailedScreen.why`."""
    positioning_s: float = 0.0
    """From the mirror to the picture, of all captures together."""
    _code: str | None = None
    _since_s: float = 0.0

    def sample(self, code: str | None, now_s: float) -> None:
        """Note what is wrong with a sample: it counts until the next."""
        if self._code is not None:
            self.seconds[self._code] += min(max(now_s - self._since_s, 0.0), _LONGEST_S)
        self._code, self._since_s = code or GOOD, now_s

    def stop(self) -> None:
        """Note that no more samples come."""
        self._code = None

    def as_dict(self) -> dict[str, object]:
        """Give all figures for the operator's page, seconds to a tenth."""
        return {
            "seconds": {code: round(s, 1) for code, s in sorted(
                self.seconds.items(), key=lambda one: -one[1])},
            "visits": self.visits, "captures": self.captures, "faces": self.faces,
            "kept": self.kept, "ends": dict(self.ends), "failures": dict(self.failures),
            "positioning_s": round(self.positioning_s, 1),
        }
