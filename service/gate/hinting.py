"""Hints over time: what is wrong with each frame, and one thing to say, for long enough."""

from typing import NamedTuple

from denseface.recon.quality import Quality
from denseface.service.gate.faults import Fault
from denseface.service.gate.judging import faults_of
from denseface.service.gate.thresholds import Thresholds
from denseface.service.protocol.hint import Hint

__all__ = ["SHOWN_S", "Hinting", "Judged"]

SHOWN_S = 0.8
"""A hint is said for at least so long: the time to read three words."""
_MAX_CODES = 8
"""Codes in a hint."""


class Judged(NamedTuple):
    """A frame's quality and what follows from it."""

    quality: Quality
    faults: tuple[Fault, ...]
    """What is wrong with this very frame, the most important first."""
    hint: Hint
    """The same for the person. Its text is that of the first fault, or of one that was first a
    moment ago: no text is shown for less than `SHOWN_S`."""

    @property
    def ready(self) -> bool:
        """Whether the frame is good enough."""
        return not self.faults

    @property
    def motion_known(self) -> bool:
        """Whether another frame was there to compare with."""
        return self.quality.face is not None and self.quality.face.motion_mm is not None

    @property
    def refusal(self) -> str:
        """Why a press does not get this frame; empty where it does."""
        return self.faults[0].text if self.faults else ""


class Hinting:
    """Judges one frame after the other."""

    def __init__(self, thresholds: Thresholds | None = None) -> None:
        self._thresholds = thresholds or Thresholds()
        self._faults: tuple[Fault, ...] = ()
        self._said: Fault | None = None
        self._since_s = 0.0

    def judge(self, quality: Quality, now_s: float) -> Judged:
        """Judge the next frame.

        Parameters
        ----------
        quality : as measured
        now_s : any clock that only goes forward, seconds
        """
        self._faults = faults_of(quality, self._thresholds, self._faults)
        first = self._faults[0] if self._faults else None
        if first is not self._said and (
                self._said is None or now_s - self._since_s >= SHOWN_S):
            self._said, self._since_s = first, now_s
        hint = Hint(timestamp_us=quality.timestamp_us,
                    codes=tuple(fault.value for fault in self._faults[:_MAX_CODES]),
                    text=self._said.text if self._said else "", measures=_measures(quality))
        return Judged(quality, self._faults, hint)


def _measures(quality: Quality) -> dict[str, float]:
    found: dict[str, float | None] = {"faces": quality.faces}
    face = quality.face
    if face is not None:
        found |= {
            "distance_mm": face.distance_mm, "off_right": face.off_center[0],
            "off_below": face.off_center[1], "turn_deg": face.turn_deg, "tilt_deg": face.tilt_deg,
            "coverage": face.coverage, "motion_mm": face.motion_mm, "sharpness": face.sharpness,
            "dark": face.dark, "burnt": face.burnt,
            "box_x_px": face.box[0], "box_y_px": face.box[1],
            "box_width_px": face.box[2], "box_height_px": face.box[3],
        }
    return {name: round(float(value), 3) for name, value in found.items() if value is not None}
