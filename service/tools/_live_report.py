"""What is shown of a live run: a status line meanwhile, a summary at the end."""

import json
import shutil
import sys
import time
from importlib.metadata import version
from typing import Self

from denseface.recon import Face, Settings
from denseface.service.runtime.terminal import printable
from denseface.service.tools._live_statistics import LiveFrame, LiveStatistics

_REFRESH_S = 0.1
"""Shortest time between two writings of the status line, seconds."""


class StatusLine:
    """One line on stderr, where that is a terminal; cleared at the end of the `with` block."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()
        self._due = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            self._write("")

    def show(self, done: LiveFrame, statistics: LiveStatistics) -> None:
        """Show the newest frame, unless the line was written just now."""
        if not self._shown or (now := time.monotonic()) < self._due:
            return
        self._due = now + _REFRESH_S
        if isinstance(done.outcome, Face):
            report = done.outcome.report
            outcome = f"{report.dense_points:,} points in {report.timings_ms['total']:.0f} ms"
        else:
            outcome = str(done.outcome)
        self._write(f"{statistics.frames} frames, {statistics.recent_rate:.1f} a second: {outcome}")

    def _write(self, text: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        print(f"\r{printable(text)[:width]}\x1b[K", end="", file=sys.stderr, flush=True)


def text_summary(warm_ms: float, statistics: LiveStatistics) -> str:
    """Give the run's counts, then a table of stage times."""
    lines = [f"{statistics.frames} frames in {statistics.seconds:.1f} s, "
             f"{statistics.rate:.1f} a second; warm after {warm_ms:.0f} ms",
             f"{statistics.faces} with a face"]
    if points := statistics.points():
        lines[-1] += f", {points[0]:,} measured and {points[1]:,} dense points (medians)"
    lines += [f"{number} without: {name}" for name, number in sorted(statistics.failures.items())]
    lines += ["", f"{'stage':14}{'median, ms':>12}{'p99, ms':>12}"]
    lines += [f"{stage:14}{median:12.1f}{p99:12.1f}"
              for stage, (median, p99) in statistics.stages_ms().items()]
    return "\n".join(lines)


def json_summary(uri: str, settings: Settings, warm_ms: float, statistics: LiveStatistics) -> str:
    """Give the same, with source, settings and version, as one JSON object."""
    points = statistics.points() or (None, None)
    return json.dumps({
        "source": uri,
        "frames": statistics.frames,
        "faces": statistics.faces,
        "failures": dict(sorted(statistics.failures.items())),
        "seconds": round(statistics.seconds, 3),
        "frames_per_second": round(statistics.rate, 2),
        "initial_points": points[0],
        "dense_points": points[1],
        "warm_ms": round(warm_ms, 1),
        "timings_ms": {stage: {"median": round(median, 2), "p99": round(p99, 2)}
                       for stage, (median, p99) in statistics.stages_ms().items()},
        "settings": settings.model_dump(mode="json"),
        "version": version("denseface"),
    })
