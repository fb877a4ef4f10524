"""The frame, and what is measured on it."""

import os
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame, open_source
from denseface.capture.calibration_files import read_calibration
from denseface.capture.image_pair import read_color_image, read_depth_image
from denseface.recon import Settings, reconstruct, warm
from denseface.service.runtime.terminal.progress import Progress

__all__ = ["Speed", "Times", "measure_speed", "sample_frame"]

SAMPLE = Path(__file__).parent / "sample"
"""Frame 0 of `fixtures/recorded_oni/wall_close.oni`: a simulated sensor looks at ICT-FaceKit's
neutral head (MIT; `recon/prior/LICENSE-ICT-FaceKit.txt`). Depth as it is, colour as JPEG."""
_SETTLING = 2
"""Rounds before those that count."""
_BUSY = 1.25
"""Time of the clock over the processor's from which on other programs were in the way."""


@dataclass(frozen=True)
class Times:
    """What took how long, milliseconds."""

    least: float
    median: float
    slowest: float

    @classmethod
    def of(cls, taken: Sequence[float]) -> "Times":
        """Give the figures of several runs."""
        return cls(min(taken), statistics.median(taken), max(taken))


@dataclass(frozen=True)
class Speed:
    """What was measured of one frame.

    Attributes
    ----------
    frame : what it is, and of what size
    preset : of the reconstruction
    rounds : how often each was done, by turns
    points : measured and dense points of the face
    stages : stage -> its times; stages that take less than a tenth of a millisecond too
    whole : of a frame from images to face
    search : of OpenCV's own face search in the same picture, on one thread; None without colour
    cores : of this machine, for this process
    busy : other programs took a part of the time
    """

    frame: str
    preset: str
    rounds: int
    points: tuple[int, int]
    stages: Mapping[str, Times]
    whole: Times
    search: Times | None
    cores: int
    busy: bool

    @property
    def ratio(self) -> float | None:
        """Of a frame's least time to that of OpenCV's search: nearly the same on all machines."""
        return self.whole.least / self.search.least if self.search else None

    @property
    def faces_per_second(self) -> float:
        """What one worker makes."""
        return 1000 / self.whole.median


def sample_frame() -> RgbdFrame:
    """Give the frame that comes along."""
    return RgbdFrame(
        read_depth_image(SAMPLE / "depth.png").astype(np.uint16),
        read_color_image(SAMPLE / "color.jpg"), 0, 0,
        read_calibration(SAMPLE / "calibration.json").calibration,
        depth_meaning=DepthMeaning(rounding=DepthRounding.CUT, max_mm=10_000),
        origin=FrameOrigin(source="a simulated frame"))


def measure_speed(
    uri: str | None, calibration: Path | None, settings: Settings, rounds: int,
    clock: Callable[[], float] = time.perf_counter,
) -> Speed:
    """Reconstruct one frame again and again, by turns with OpenCV's face search.

    Parameters
    ----------
    uri : what `open_source` takes, of which the first frame is taken; None for `sample_frame`
    calibration : wins over the source's own
    rounds : that count, after a few that do not

    Raises
    ------
    CaptureError
        The source cannot be read.
    ReconstructionError
        There is no face in the frame.
    """
    cv2.setNumThreads(1)
    frame = _frame(uri, calibration)
    warm()
    gray: NDArray[Any] | None = (
        None if frame.color is None else cv2.cvtColor(frame.color, cv2.COLOR_RGB2GRAY))
    search = _default_search()
    stages: dict[str, list[float]] = {}
    searches: list[float] = []
    began, processor = 0.0, 0.0
    with Progress("measuring", total=rounds, unit="rounds") as progress:
        for number in range(-_SETTLING, rounds):
            if number == 0:
                stages.clear()
                searches.clear()
                began, processor = clock(), time.process_time()
            face = reconstruct(frame, settings)
            for name, ms in face.report.timings_ms.items():
                stages.setdefault(name, []).append(ms)
            if gray is not None:
                start = clock()
                search(gray)
                searches.append((clock() - start) * 1e3)
            if number >= 0:
                progress.advance()
        passed, processor = clock() - began, time.process_time() - processor
    whole = Times.of(stages.pop("total"))
    height, width = frame.depth.shape
    return Speed(
        f"{frame.origin.source or uri}, {width}x{height}", str(settings.preset), rounds,
        (len(face.initial), len(face.dense)),
        {name: Times.of(taken) for name, taken in stages.items()}, whole,
        Times.of(searches) if searches else None, len(os.sched_getaffinity(0)),
        passed > _BUSY * processor)


def _frame(uri: str | None, calibration: Path | None) -> RgbdFrame:
    if uri is None:
        frame = sample_frame()
        if calibration is None:
            return frame
        chosen = read_calibration(calibration)
        return frame.with_calibration(chosen.calibration, chosen.origin)
    with open_source(uri, calibration) as source:
        return next(iter(source))


def _default_search() -> Callable[[NDArray[Any]], object]:
    """Give OpenCV's frontal cascade with its defaults."""
    folder = Path(cv2.__file__).parent / "data"
    return cv2.CascadeClassifier(
        str(folder / "haarcascade_frontalface_default.xml")).detectMultiScale
