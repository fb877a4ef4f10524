"""What was measured, in words and as JSON."""

import json
import platform
from collections.abc import Iterator
from dataclasses import asdict

from denseface.service.tools.bench.measuring import Speed, Times
from denseface.version import VERSION

__all__ = ["as_json", "as_lines"]

_STAGES = {
    "overview": "where in the depth heads may be",
    "detection": "which of them has a face",
    "registration": "depth and colour laid over each other",
    "segmentation": "what of it is face",
    "neighbors": "how far measured points are apart",
    "rbf": "the smooth surface through them",
    "judgement": "does it have a face's shape?",
    "propagation": "dense points, normals, colours, sigma",
}
"""Stage -> what it finds."""
_SENSOR_RATE = 30
"""Frames a second of the sensors that are served."""


def as_lines(speed: Speed) -> Iterator[str]:
    """Give the table, and what it means."""
    measured, dense = speed.points
    yield (f"{speed.frame}, preset {speed.preset}: {measured:,} measured and {dense:,} dense "
           "points")
    yield f"{speed.rounds} rounds on one of {speed.cores} cores, milliseconds"
    yield ""
    yield f"{'':16}{'least':>9}{'median':>9}{'slowest':>9}"
    for name, times in speed.stages.items():
        yield _row(name, times, _STAGES.get(name, ""))
    yield _row("a whole frame", speed.whole, "from the images to the face")
    if speed.search:
        yield _row("OpenCV's search", speed.search,
                   "for faces in the same picture, with its defaults")
    yield ""
    if speed.ratio is not None:
        yield (f"A frame takes {speed.ratio:.2f} of the time of OpenCV's face search alone, on one "
               "thread: compare machines by the times, releases by this.")
    rate = speed.faces_per_second
    keeps_up = "more than" if rate >= _SENSOR_RATE else "less than"
    yield (f"A worker makes {rate:.0f} faces a second here, {keeps_up} the {_SENSOR_RATE} frames "
           "that a sensor gives.")
    if speed.busy:
        yield "Other programs were busy meanwhile: on a quiet machine it is faster."


def _row(name: str, times: Times, meaning: str) -> str:
    return f"{name:16}{times.least:9.1f}{times.median:9.1f}{times.slowest:9.1f}  {meaning}".rstrip()


def as_json(speed: Speed) -> str:
    """Give the same as one JSON object."""
    def figures(times: Times) -> dict[str, float]:
        return {name: round(ms, 3) for name, ms in asdict(times).items()}

    return json.dumps({
        "frame": speed.frame, "preset": speed.preset, "rounds": speed.rounds,
        "initial_points": speed.points[0], "dense_points": speed.points[1],
        "timings_ms": {name: figures(times) for name, times in speed.stages.items()},
        "total_ms": figures(speed.whole),
        "opencv_search_ms": figures(speed.search) if speed.search else None,
        "ratio": None if speed.ratio is None else round(speed.ratio, 3),
        "faces_per_second": round(speed.faces_per_second, 1),
        "cores": speed.cores, "busy": speed.busy, "machine": platform.machine(),
        "python": platform.python_version(), "version": VERSION})
