"""How many frames go into a task: as many as take a third of a second."""

__all__ = ["LONGEST_S", "FrameTimes"]

TASK_S = 0.35
"""Time of a task, seconds: shorter, and the scheduler's share shows; longer, and much is lost with
a worker."""
LONGEST_S = 0.5
"""After which a task begins no further frame."""
_FIRST = 2
"""Frames of the tasks that are sent before any came back."""
_MOST = 256
"""Frames of a task, however fast they are: their rows come back together."""
_WEIGHT = 0.25
"""Of the newest task in the mean."""


class FrameTimes:
    """The mean time of a frame, of the tasks that came back."""

    def __init__(self) -> None:
        self._frame_s: float | None = None

    def add(self, frames: int, seconds: float) -> None:
        """Count a task: how many frames were looked at, and the time that took."""
        if frames < 1 or seconds <= 0:
            return
        frame_s = seconds / frames
        self._frame_s = frame_s if self._frame_s is None else (
            (1 - _WEIGHT) * self._frame_s + _WEIGHT * frame_s)

    @property
    def frames(self) -> int:
        """How many frames the next task is to have."""
        if self._frame_s is None:
            return _FIRST
        return max(1, min(_MOST, round(TASK_S / self._frame_s)))
