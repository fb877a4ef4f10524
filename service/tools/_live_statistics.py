"""Counts and times of a live run."""

import re
import time
from collections import Counter, deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from denseface.capture import RgbdFrame
from denseface.recon import Face, ReconstructionError

_MAX_TIMES = 3600
"""Frames whose stage times are kept, the newest: a run may last for days."""
_RECENT_FRAMES = 30
"""Frames that the recent rate is measured over: about a second of a sensor."""

Clock = Callable[[], float]
"""Gives seconds from any start."""


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """A frame and what became of it: its face, or why there is none."""

    frame: RgbdFrame
    outcome: Face | ReconstructionError
    timings_ms: dict[str, float]
    """Wall time of `capture`, the wait for the frame, then of each stage, and `total` without the
    wait; where there is no face, of `capture` and `without_face`."""


class LiveStatistics:
    """Counts and times of a live run, from when this is made."""

    def __init__(self, clock: Clock = time.perf_counter) -> None:
        self._clock = clock
        self._start = self._last = clock()
        self._ends = deque([self._start], _RECENT_FRAMES + 1)
        self._times: dict[str, deque[float]] = {}
        self._points: deque[tuple[int, int]] = deque(maxlen=_MAX_TIMES)
        self.failures: Counter[str] = Counter()
        self.warnings: Counter[str] = Counter()
        """Of the faces' reports; a number counts as any other."""
        self.frames = 0

    def add(self, frame: LiveFrame) -> None:
        """Count one frame that ends now."""
        self._last = self._clock()
        self._ends.append(self._last)
        self.frames += 1
        if isinstance(frame.outcome, Face):
            self._points.append((len(frame.outcome.initial), len(frame.outcome.dense)))
            self.warnings.update(
                re.sub(r"\d+(\.\d+)?", "N", one) for one in frame.outcome.report.warnings)
        else:
            self.failures[type(frame.outcome).__name__] += 1
        for stage, ms in frame.timings_ms.items():
            self._times.setdefault(stage, deque(maxlen=_MAX_TIMES)).append(ms)

    @property
    def faces(self) -> int:
        """How many frames gave a face."""
        return self.frames - self.failures.total()

    @property
    def seconds(self) -> float:
        """From the start to the end of the last frame."""
        return self._last - self._start

    @property
    def rate(self) -> float:
        """Frames a second so far; 0 before the first."""
        return self.frames / self.seconds if self.seconds else 0.0

    @property
    def recent_rate(self) -> float:
        """Frames a second over the last second or so; 0 before the first."""
        passed = self._ends[-1] - self._ends[0]
        return (len(self._ends) - 1) / passed if passed else 0.0

    def points(self) -> tuple[int, int] | None:
        """Give the medians of initial and dense points; None before the first face."""
        if not self._points:
            return None
        initial, dense = np.median(np.array(self._points), axis=0)
        return round(float(initial)), round(float(dense))

    def stages_ms(self) -> dict[str, tuple[float, float]]:
        """Give the median and the 99th percentile of each stage's time."""
        return {stage: (float(np.median(list(times))), float(np.percentile(list(times), 99)))
                for stage, times in self._times.items()}
