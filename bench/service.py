"""What the service adds to the bare function: overhead, throughput, latency, idle cost."""

import argparse
import logging
import os
import statistics
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import cv2
import numpy as np
import structlog

from bench.accuracy import RECORDINGS
from bench.machine import describe
from bench.service_processes import Bare, Running, kind_of, running
from bench.service_steps import Laps, one_capture_each
from denseface.capture import open_source
from denseface.capture.npz import save_frame
from denseface.service.daemons.worker import warm

__all__: list[str] = []

_STEPS = ("decode", "checksum", "cached write", "direct write and sync", "encode")
_MB = 2**20


def _print_overhead(laps: Laps, source: Path, runs: int) -> None:
    medians = {name: statistics.median(taken) for name, taken in laps.ms.items()}
    bare = medians["reconstruct"]
    print("\nThe hub's process without its sockets, and its files written in the same thread "
          f"({source.stem}, frame of {laps.frame_bytes / 1e6:.1f} MB, face of {laps.points:,} "
          f"points and {laps.face_bytes / 1e6:.1f} MB), {runs} captures, each step by turns with "
          "the bare function, medians:\n")
    print("| | ms | share of `reconstruct` |\n| --- | --- | --- |")
    hub = ("accept to dispatch", "result to publication")
    rows = {"`reconstruct`": bare, **{name: medians[name] for name in hub},
            "both": sum(medians[name] for name in hub),
            "sensor: encode the frame": medians["sensor: encode frame"],
            "worker: decode the job, pack and encode the result":
                medians["worker: decode job"] + medians["worker: pack result"],
            "client: decode and unpack the face": medians["client: unpack face"]}
    for name, ms in rows.items():
        print(f"| {name} | {ms:.1f} | {100 * ms / bare:.0f} % |")
    print("\nOf that, on the same bytes alone:\n")
    print(f"| | {' | '.join(_STEPS)} |\n|{' --- |' * (1 + len(_STEPS))}")
    for what in ("frame", "face"):
        print(f"| {what}, ms | "
              + " | ".join(f"{medians[f'{what}: {step}']:.1f}" for step in _STEPS) + " |")


def _print_throughput(rates: dict[str, list[float]], rounds: int, count: int) -> None:
    print(f"\nThroughput on that frame, {rounds} rounds of {count} captures by turns, medians. A "
          "round of the service lasts from the first press to the last publication, the next press "
          "as soon as the last is accepted:\n")
    print("| | captures / s | of the bare function |\n| --- | --- | --- |")
    for workers in (1, 2):
        name, bare = (f"{what}, {workers}" for what in ("service", "bare"))
        ratios = [ours / theirs for ours, theirs in zip(rates[name], rates[bare], strict=True)]
        print(f"| `reconstruct` in a loop, {workers} process{'es' * (workers > 1)} "
              f"| {statistics.median(rates[bare]):.1f} | |")
        print(f"| service, {workers} worker{'s' * (workers > 1)} "
              f"| {statistics.median(rates[name]):.1f} | {100 * statistics.median(ratios):.0f} % "
              f"({100 * min(ratios):.0f} to {100 * max(ratios):.0f}; goal 90) |")


def _processor_s(side: Bare | Running) -> dict[str, float]:
    return {"bare": side.processor_s()} if isinstance(side, Bare) else side.processor_s()


def _print_processor_time(used: dict[int, dict[str, float]], captures: int) -> None:
    """Where all cores are busy no pipeline is faster than its processor time."""
    cores = len(os.sched_getaffinity(0))
    names = ("bare", "worker", "hub", "capture", "client")
    print(f"\nProcessor time for one capture, ms, of the same rounds; the client is this program, "
          f"and no share is above what {cores} cores could give if all of it were spread evenly:\n")
    print(f"| workers | {' | '.join(names[1:])} | all | bare function | share at most |\n"
          f"|{' --- |' * (len(names) + 3)}")
    for workers, one in used.items():
        ms = {name: one[name] / captures * 1e3 for name in names}
        total = sum(ms.values()) - ms["bare"]
        most = min(1.0, cores / workers * ms["bare"] / total)
        print(f"| {workers} | {' | '.join(f'{ms[name]:.1f}' for name in names[1:])} "
              f"| {total:.1f} | {ms['bare']:.1f} | {100 * most:.0f} % |")


def _latency(service: Running, presses: int) -> tuple[list[float], list[float]]:
    """Milliseconds from each press to its acknowledgement, and to the face at a subscriber."""
    accepted, published = [], []
    faces = service.client.published(after=service.client.status().sequence, timeout=60)
    for _ in range(presses):
        start = time.perf_counter()
        service.client.press()
        accepted.append((time.perf_counter() - start) * 1e3)
        next(faces)
        published.append((time.perf_counter() - start) * 1e3)
    return accepted, published


def _idle(service: Running, seconds: float) -> list[tuple[str, float, float]]:
    """Name, share of a core in % and memory (USS) in MiB of each process while nobody presses."""
    family = service.family()
    before = [sum(one.cpu_times()[:2]) for one in family]
    time.sleep(seconds)
    return [(kind_of(one), 100 * (sum(one.cpu_times()[:2]) - was) / seconds,
             one.memory_full_info().uss / _MB)
            for one, was in zip(family, before, strict=True)]


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="script/bench service", description=__doc__)
    parser.add_argument("--source", type=Path, default=RECORDINGS / "frontal_700.oni",
                        help="recording whose first frame is served (frontal_700)")
    # So many that filling and draining the pipeline is no part of the result.
    parser.add_argument("--captures", type=int, default=100, help="of one round (100)")
    parser.add_argument("--rounds", type=int, default=5, help="of throughput (5)")
    parser.add_argument("--presses", type=int, default=200, help="for the latency (200)")
    parser.add_argument("--idle", type=float, default=20.0, help="seconds (20)")
    args = parser.parse_args()
    if min(args.captures, args.rounds, args.presses) < 1 or args.idle < 1:
        parser.error("--captures, --rounds, --presses and --idle must be at least 1")
    structlog.configure(wrapper_class=structlog.make_filtering_bound_logger(logging.ERROR))
    cv2.setNumThreads(1)
    print(describe("script/bench service " + " ".join(sys.argv[1:])), flush=True)
    warm()
    rates: dict[str, list[float]] = {}
    used: dict[int, dict[str, float]] = {}
    accepted: list[float] = []
    published: list[float] = []
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="df-")))
        runs = min(args.captures, 30)
        with open_source(str(args.source)) as frames:
            frame = next(iter(frames))
        _print_overhead(one_capture_each(folder, frame, runs), args.source, runs)
        # Both sides have it in memory. The recording itself has three frames and OpenNI2 takes
        # 110 ms to begin it again: 26 frames a second, less than one worker can do.
        source = folder / "frame.npz"
        save_frame(frame, source)
        services = {count: stack.enter_context(running(source, count)) for count in (1, 2)}
        bare = {count: Bare(source, count) for count in (1, 2)}
        for each in bare.values():
            stack.callback(each.close)
        for service in services.values():
            service.throughput(2)  # both workers have seen a frame
        for turn in range(args.rounds):
            for name, sides in (("bare", bare), ("service", services)):
                for count, side in sides.items():
                    before = _processor_s(side)
                    rates.setdefault(f"{name}, {count}", []).append(
                        args.captures / side.throughput(args.captures))
                    for process, seconds in _processor_s(side).items():
                        total = used.setdefault(count, {})
                        total[process] = total.get(process, 0.0) + seconds - before[process]
            some = args.presses * (turn + 1) // args.rounds - args.presses * turn // args.rounds
            for into, found in zip((accepted, published), _latency(services[1], some),
                                   strict=True):
                into += found
        _print_throughput(rates, args.rounds, args.captures)
        _print_processor_time(used, args.rounds * args.captures)
        print(f"\nFrom a press, {args.presses} of them between those rounds, 1 worker:\n")
        print("| until | p50, ms | p99, ms |\n| --- | --- | --- |")
        for what, taken in (("it is accepted", accepted),
                            ("a subscriber has the face", published)):
            print(f"| {what} | {np.percentile(taken, 50):.0f} | {np.percentile(taken, 99):.0f} |")
        idle = _idle(services[2], args.idle)
        print(f"\nIdle, over {args.idle:g} s:\n\n| process | processor, % of a core "
              "| own memory, MiB |\n| --- | --- | --- |")
        for name, cpu, memory in [*idle, ("all", *map(sum, zip(*[one[1:] for one in idle],
                                                               strict=True)))]:
            print(f"| {name} | {cpu:.2f} | {memory:.0f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
