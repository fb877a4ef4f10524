"""A live sensor, on the virtual one: how fresh a press's frame is, what it costs, if it lasts.

The virtual sensor tells in each frame's pixels when it was exposed. Its own threads are left out of
the processor time.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from bench.capture_faults import recoveries
from bench.capture_probe import Copies, PressTimes
from bench.capture_service import Resources, idle_and_previews, replugs, steady
from bench.machine import describe
from tests.virtual_sensor.control import Control
from tests.virtual_sensor.process import environment
from tests.virtual_sensor.scenes import cheap_clip

__all__: list[str] = []

_PERIOD_MS = 1000 / 30
_PIPELINES_MS = (0, 33, 66)
_JITTER_US = 3000
_MARGIN_MS = 5
"""More than the delay, where it is said to be known: the jitter, and the driver's own work."""
_FIRST_FRAME_US = 300_000
"""From the start of the streams to the first exposure: real sensors take 0.3 to 1 s."""
_SPEED = 10.0
"""Of the sensor in the long run: 300 frames a second."""
_REPLUG_S = 2.0
"""Goal for the time from the plug to a press that is answered, without the warm-up."""


def _probe(
    folder: Path, clip: Path, what: str, count: int, *more: object, **fields: object
) -> object:
    with Control(folder / "sensor", clip, marks=True, **fields) as sensor:
        done = subprocess.run(
            [sys.executable, "-m", "bench.capture_probe", what, str(count), *map(str, more)],
            env=os.environ | environment(controls=[sensor]), stdout=subprocess.PIPE, check=True)
    return json.loads(done.stdout)


def _print_presses(folder: Path, clip: Path, count: int) -> None:
    for first_frame_us in (0, _FIRST_FRAME_US):
        _print_presses_of(folder, clip, count, first_frame_us)
    print(f"\nThe same where the delay is known to {_MARGIN_MS} ms (DENSEFACE_SENSOR_DELAY_MS):\n")
    _print_press_table(folder, clip, count, _FIRST_FRAME_US, known=True)


def _print_presses_of(folder: Path, clip: Path, count: int, first_frame_us: int) -> None:
    print(f"\nA sensor whose first frame is exposed {first_frame_us / 1000:g} ms and a period "
          "after its streams were started. From the press to the true exposure of the frame it "
          f"gets, in frame periods of {_PERIOD_MS:.1f} ms; {count:,} presses each, at any phase; "
          f"up to {_JITTER_US / 1000:g} ms of jitter in the delivery. Stale: exposed before the "
          "press. The estimate is how much too early the exposure was taken to be, at most:\n")
    _print_press_table(folder, clip, count, first_frame_us)


def _print_press_table(
    folder: Path, clip: Path, count: int, first_frame_us: int, *, known: bool = False
) -> None:
    print("| from exposure to delivery, ms | stale | p50 | p99 | goal | answered after, ms, p50 | "
          "p99 | largest true skew, ms | estimate, ms |")
    print("|" + " --- |" * 9)
    for pipeline_ms in _PIPELINES_MS:
        transport_s = [(pipeline_ms + _MARGIN_MS) / 1000] if known else []
        found = _probe(folder, clip, "presses", count, *transport_s,
                       pipeline_us=pipeline_ms * 1000, jitter_us=_JITTER_US,
                       first_frame_us=first_frame_us)
        times = [PressTimes(**one) for one in found]  # type: ignore[attr-defined]
        after = np.array([one.exposed_after for one in times]) / _PERIOD_MS
        answered = np.array([one.answered_after for one in times])
        pipeline = pipeline_ms / _PERIOD_MS
        print(f"| {pipeline_ms} | {(after < 0).sum()} of {count:,} | {np.median(after):.2f} "
              f"| {np.percentile(after, 99):.2f} | 0, {1.2 + pipeline:.1f}, {2 + pipeline:.1f} "
              f"| {np.median(answered):.0f} | {np.percentile(answered, 99):.0f} "
              f"| {max(abs(one.skew) for one in times):.1f} "
              f"| {max(one.estimate_early for one in times):.0f} |", flush=True)


def _print_copies(folder: Path, clip: Path, pairs: int) -> None:
    copies = Copies(**_probe(folder, clip, "copies", pairs))  # type: ignore[arg-type]
    print(f"\nReading a pair takes the thread {copies.read_ms:.2f} ms of processor time, one copy "
          f"of its bytes {copies.copy_ms:.2f} ms ({pairs:,} pairs). At most "
          f"{copies.allocated_kb:.0f} kB are allocated meanwhile: each image is copied once, into "
          "memory that was there before.")


def _print_costs(folder: Path, clip: Path, seconds: float) -> None:
    with Control(folder / "sensor", clip) as sensor:
        idle, previews, rate, age_ms = idle_and_previews(sensor, seconds)
    print(f"\nThe capture process under `up`, without the virtual sensor's threads, for "
          f"{seconds:g} s each:\n")
    print("| | % of a core | goal |\n| --- | --- | --- |")
    print(f"| nobody presses | {idle:.1f} | |")
    print(f"| one subscriber to previews, {rate:.1f} a second, p95 of their age "
          f"{age_ms:.0f} ms | {previews:.1f} | 25 |", flush=True)


def _print_steady(folder: Path, clip: Path, frames: int) -> None:
    with Control(folder / "sensor", clip, speed=_SPEED) as sensor:
        taken = list(steady(sensor, frames))
    _print_resources(f"{frames:,} frames of each stream under `up`, at {_SPEED:g} times the speed",
                     "frames", taken)


def _print_replugs(folder: Path, clip: Path, cycles: int) -> None:
    with Control(folder / "sensor", clip) as sensor:
        seconds, streamed, taken = replugs(sensor, cycles)
    print(f"\n{cycles} times unplugged and plugged in under another address, under `up`: from the "
          f"plug to the first press with a frame {statistics.median(seconds):.2f} s (p50), "
          f"{np.percentile(seconds, 99):.2f} s (p99), {max(seconds):.2f} s (longest); goal "
          f"{_REPLUG_S:g} s for 99 of 100 and the warm-up. The sensor's first frame came after "
          f"{statistics.median(streamed):.2f} s (p50), {np.percentile(streamed, 99):.2f} s (p99).")
    _print_resources("The same run", "cycles", taken)


def _print_faults(folder: Path, clip: Path, rounds: int) -> None:
    with Control(folder / "sensor", clip) as sensor:
        found, held, processes = recoveries(sensor, rounds)
    seconds = [one.seconds for one in found]
    worst = max(found, key=lambda one: one.seconds)
    print(f"\n{rounds} rounds of one to three random faults under `up`: from the end of the last "
          f"to a press with a frame {statistics.median(seconds):.2f} s (p50), "
          f"{worst.seconds:.2f} s (longest, after {', '.join(worst.faults)}). "
          f"{processes} capture processes; the last "
          f"holds {held.memory_mib:.0f} MiB, {held.descriptors} descriptors, {held.threads} "
          "threads.", flush=True)


def _print_resources(title: str, unit: str, taken: Iterable[tuple[int, Resources]]) -> None:
    print(f"\n{title}, the capture process:\n")
    print(f"| {unit} | memory (USS), MiB | descriptors | threads | process |\n|" + " --- |" * 5)
    first = None
    for count, one in taken:
        first = first or one.pid
        print(f"| {count:,} | {one.memory_mib:.1f} | {one.descriptors} | {one.threads} "
              f"| {'the same' if one.pid == first else 'another'} |", flush=True)


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="script/bench capture", description=__doc__)
    parser.add_argument("--presses", type=int, default=1000, help="at each delay (1000)")
    parser.add_argument("--pairs", type=int, default=1000, help="read for the copies (1000)")
    parser.add_argument("--seconds", type=float, default=30, help="of each processor load (30)")
    parser.add_argument("--frames", type=int, default=100_000, help="of the long run (100,000)")
    parser.add_argument("--cycles", type=int, default=500, help="of plugging (500)")
    parser.add_argument("--faults", type=int, default=100, help="rounds of them (100)")
    args = parser.parse_args()
    print(describe(" ".join(["script/bench capture", *sys.argv[1:]])))
    parts = ((_print_presses, args.presses), (_print_copies, args.pairs),
             (_print_costs, args.seconds), (_print_steady, args.frames),
             (_print_replugs, args.cycles), (_print_faults, args.faults))
    with tempfile.TemporaryDirectory(prefix="df-") as name:
        clip = cheap_clip(Path(name) / "clip")
        for part, count in parts:
            if count:
                part(Path(name), clip, count)
    return 0


if __name__ == "__main__":
    sys.exit(main())
