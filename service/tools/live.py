"""Reconstruct whatever a source gives, frame after frame, and keep the times."""

import time
from collections import Counter, deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from denseface.capture import RgbdFrame, Source
from denseface.capture.errors import UnreadableSourceError
from denseface.recon import Face, ReconstructionError, Settings, reconstruct, warm

__all__ = ["LiveFrame", "Tally", "live"]

# Stage times are kept of so many frames, the newest ones: a run may last for days.
_KEPT = 3600
_RECENT = 30

Clock = Callable[[], float]


@dataclass(frozen=True, eq=False)
class LiveFrame:
    """What became of one frame.

    Attributes
    ----------
    frame : what the source gave
    outcome : its face, or why there is none
    timings_ms : wall time of `capture`, the wait for the frame, then of each stage, and `total`
        without the wait; where there is no face, of `capture` and `without_face`
    """

    frame: RgbdFrame
    outcome: Face | ReconstructionError
    timings_ms: dict[str, float]


def live(
    source: Source, settings: Settings, clock: Clock = time.perf_counter
) -> Iterator[LiveFrame]:
    """Reconstruct each frame of a source; recordings begin again at their end.

    A frame without a face is an outcome like any other. The kernels are warm before the first
    frame is asked for.

    Parameters
    ----------
    source : an open source
    settings : of the reconstruction
    clock : seconds, from any start

    Raises
    ------
    CaptureError
        Where the source fails, or a recording holds no frame at all.
    """
    warm()
    frames = _endless(source)
    while True:
        asked = clock()
        frame = next(frames)
        begun = clock()
        try:
            outcome: Face | ReconstructionError = reconstruct(frame, settings)
        except ReconstructionError as error:
            outcome = error
        times = (outcome.report.timings_ms if isinstance(outcome, Face)
                 else {"without_face": (clock() - begun) * 1e3})
        yield LiveFrame(frame, outcome, {"capture": (begun - asked) * 1e3, **times})


def _endless(source: Source) -> Iterator[RgbdFrame]:
    while True:
        empty = True
        for frame in source:
            empty = False
            yield frame
        if empty:
            raise UnreadableSourceError(f"{source.uri}: holds no pair of depth and colour")


class Tally:
    """Counts and times of a live run, from when this is made.

    Parameters
    ----------
    clock : seconds, from any start
    """

    def __init__(self, clock: Clock = time.perf_counter) -> None:
        self._clock = clock
        self._start = self._last = clock()
        self._ends = deque([self._start], _RECENT + 1)
        self._times: dict[str, deque[float]] = {}
        self._points: deque[tuple[int, int]] = deque(maxlen=_KEPT)
        self.failures: Counter[str] = Counter()
        self.frames = 0

    def add(self, done: LiveFrame) -> None:
        """Count one frame that is done now."""
        self._last = self._clock()
        self._ends.append(self._last)
        self.frames += 1
        if isinstance(done.outcome, Face):
            self._points.append((len(done.outcome.initial), len(done.outcome.dense)))
        else:
            self.failures[type(done.outcome).__name__] += 1
        for stage, taken in done.timings_ms.items():
            self._times.setdefault(stage, deque(maxlen=_KEPT)).append(taken)

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
        return {stage: _median_p99(times) for stage, times in self._times.items()}


def _median_p99(values: deque[float]) -> tuple[float, float]:
    median, high = np.percentile(np.array(values), (50, 99))
    return float(median), float(high)
