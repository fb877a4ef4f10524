"""`denseface live`."""

import argparse
import json
import shutil
import sys
import time
from typing import TYPE_CHECKING

from denseface.service.commands import capture, options
from denseface.service.commands.press import seconds

if TYPE_CHECKING:
    from collections.abc import Iterator

    from denseface.recon.settings import Settings
    from denseface.service.runtime.signals import StopSignal
    from denseface.service.tools.live import LiveFrame, Tally

__all__ = ["add_arguments", "run"]

_REFRESH_S = 0.1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """State the flags."""
    capture.add_source(parser)
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--seconds", type=seconds, metavar="S",
                        help="end after S seconds (default: at Ctrl-C)")
    length.add_argument("--frames", type=_count, metavar="N", help="end after N frames")
    options.add_recon(parser)
    parser.add_argument("--json", action="store_true", help="print the summary as one JSON object")


def run(args: argparse.Namespace) -> int:
    """Do it."""
    options.use_one_thread()
    settings = options.recon_settings(args)

    import cv2

    from denseface.capture import open_source
    from denseface.recon import warm
    from denseface.service.runtime.signals import StopSignal
    from denseface.service.tools.live import Tally, live

    cv2.setNumThreads(1)
    with open_source(args.source, args.calibration) as source, StopSignal() as stop:
        begun = time.perf_counter()
        warm()
        warm_ms = (time.perf_counter() - begun) * 1e3
        tally = Tally()
        try:
            _watch(live(source, settings), tally, stop, args)
        finally:  # a sensor that went away leaves its figures too
            if tally.frames:
                print(_json(args.source, settings, warm_ms, tally) if args.json
                      else _table(tally, warm_ms))
        return stop.exit_status


def _watch(frames: "Iterator[LiveFrame]", tally: "Tally", stop: "StopSignal",
           args: argparse.Namespace) -> None:
    line = _StatusLine()
    try:
        for done in frames:
            tally.add(done)
            line.show(done, tally)
            if stop or tally.frames == args.frames or (
                    args.seconds is not None and tally.seconds >= args.seconds):
                return
    finally:
        line.clear()


class _StatusLine:
    """One line on stderr, where that is a terminal."""

    def __init__(self) -> None:
        self._shown = sys.stderr.isatty()
        self._due = 0.0

    def show(self, done: "LiveFrame", tally: "Tally") -> None:
        if not self._shown or (now := time.monotonic()) < self._due:
            return
        self._due = now + _REFRESH_S
        self._write(f"{tally.frames} frames, {tally.recent_rate:.1f} a second: {_said(done)}")

    def clear(self) -> None:
        if self._shown:
            self._write("")

    def _write(self, text: str) -> None:
        width = shutil.get_terminal_size().columns - 1
        print(f"\r{text[:width]}\x1b[K", end="", file=sys.stderr, flush=True)


def _said(done: "LiveFrame") -> str:
    from denseface.recon import Face

    if isinstance(done.outcome, Face):
        report = done.outcome.report
        return f"{report.dense_points:,} points in {report.timings_ms['total']:.0f} ms"
    return str(done.outcome)


def _table(tally: "Tally", warm_ms: float) -> str:
    lines = [f"{tally.frames} frames in {tally.seconds:.1f} s, {tally.rate:.1f} a second; "
             f"warm after {warm_ms:.0f} ms",
             f"{tally.faces} with a face"]
    if points := tally.points():
        lines[-1] += f", {points[0]:,} measured and {points[1]:,} dense points (medians)"
    lines += [f"{number} without: {name}" for name, number in sorted(tally.failures.items())]
    lines += ["", f"{'stage':14}{'median, ms':>12}{'p99, ms':>12}"]
    lines += [f"{stage:14}{median:12.1f}{p99:12.1f}"
              for stage, (median, p99) in tally.stages_ms().items()]
    return "\n".join(lines)


def _json(source: str, settings: "Settings", warm_ms: float, tally: "Tally") -> str:
    from importlib.metadata import version

    points = tally.points() or (None, None)
    return json.dumps({
        "source": source,
        "frames": tally.frames,
        "faces": tally.faces,
        "failures": dict(sorted(tally.failures.items())),
        "seconds": round(tally.seconds, 3),
        "frames_per_second": round(tally.rate, 2),
        "initial_points": points[0],
        "dense_points": points[1],
        "warm_ms": round(warm_ms, 1),
        "timings_ms": {stage: {"median": round(median, 2), "p99": round(p99, 2)}
                       for stage, (median, p99) in tally.stages_ms().items()},
        "settings": settings.model_dump(mode="json"),
        "version": version("denseface"),
    })


def _count(text: str) -> int:
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text!r}: expected a whole number, at least 1")
    return int(text)
