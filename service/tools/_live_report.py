"""What is shown of a live run: a status line meanwhile, a summary at the end."""

import json

from denseface.recon import Face, Settings
from denseface.service.tools._live_statistics import LiveFrame, LiveStatistics
from denseface.version import VERSION


def status(done: LiveFrame, statistics: LiveStatistics) -> str:
    """Say in a line what the newest frame gave."""
    if isinstance(done.outcome, Face):
        report = done.outcome.report
        outcome = f"{report.dense_points:,} points in {report.timings_ms['total']:.0f} ms"
    else:
        outcome = str(done.outcome)
    return f"{statistics.frames} frames, {statistics.recent_rate:.1f} a second: {outcome}"


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
        "version": VERSION,
    })
