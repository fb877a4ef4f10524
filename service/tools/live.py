"""Reconstruct whatever a source gives, frame after frame, and show the times."""

import time
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import cv2

from denseface.capture import RgbdFrame, Source, open_source
from denseface.capture.errors import UnreadableSourceError
from denseface.recon import Face, ReconstructionError, Settings, reconstruct, warm
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.terminal import complain, say
from denseface.service.runtime.terminal.progress import Progress
from denseface.service.tools._live_report import json_summary, status, text_summary
from denseface.service.tools._live_statistics import Clock, LiveFrame, LiveStatistics

__all__ = ["reconstruct_frames", "run"]


def run(
    uri: str, calibration: Path | None, settings: Settings, *, rotation: int = 0,
    frames: int | None = None, seconds: float | None = None, as_json: bool = False,
) -> int:
    """Reconstruct the frames of a source, print a summary and give the exit status.

    Ends after so many frames or seconds, or at SIGINT or SIGTERM.

    Raises
    ------
    CaptureError
        Where the source cannot be opened or fails; the summary is printed all the same.
    """
    cv2.setNumThreads(1)
    with open_source(uri, calibration, rotation=rotation) as source, StopSignal() as stop:
        begun = time.perf_counter()
        warm()
        warm_ms = (time.perf_counter() - begun) * 1e3
        statistics = LiveStatistics()
        try:
            with Progress(f"Ctrl-C ends it; reconstructing {uri}") as line:
                for done in reconstruct_frames(source, settings):
                    statistics.add(done)
                    line.show(partial(status, done, statistics))
                    if stop or statistics.frames == frames or (
                            seconds is not None and statistics.seconds >= seconds):
                        break
        finally:
            if statistics.frames:
                say(*(json_summary(uri, settings, warm_ms, statistics) if as_json
                      else text_summary(warm_ms, statistics)).split("\n"))
                for warning, number in statistics.warnings.most_common():
                    complain(f"warning, {number} of {statistics.frames} frames: {warning}")
        return stop.exit_status


def reconstruct_frames(
    source: Source, settings: Settings, clock: Clock = time.perf_counter
) -> Iterator[LiveFrame]:
    """Reconstruct each frame of a source; recordings begin again at their end, unless told not to.

    A frame without a face is an outcome like any other. The kernels are warm before a frame is
    asked for.

    Raises
    ------
    CaptureError
        Where the source fails, or a recording holds no frame at all.
    """
    warm()
    frames = _endless(source)
    while True:
        asked = clock()
        frame = next(frames, None)
        if frame is None:
            return
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
        if not getattr(source, "repeats", True):  # another's source need not say
            return
