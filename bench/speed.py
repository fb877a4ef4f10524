"""How long a frame takes, stage by stage; the fit against others; growth; memory."""

import argparse
import statistics
import sys
import time
from collections.abc import Callable
from functools import partial
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.cases import Case, recorded, with_preset
from bench.dense_solve import dense_heights
from bench.flags import add_flags, check_flags, open_pcl
from bench.growth import growth
from bench.machine import describe
from bench.memory import extra_memory, resident_mb
from bench.own import after_segmentation, default_haar, milliseconds
from bench.pcl_peer import Pcl
from bench.peer_methods import inpaint_points, rbf_points
from denseface.recon import Preset, Settings, pipeline, reconstruct, warm
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.noise import Risk, measure_noise
from denseface.recon.registration import register, sample_colors
from denseface.recon.surface import MIN_SEEDS, fit_surface

__all__: list[str] = []

_OF = "frontal_700/0"
# About 100,000 points, the goal's number.
_GOAL_OF = "dark_skin/0"
_SIGMA_PX = 2.0
_PCL_RADIUS_MM = 10.0
# In place of the stages' own clock: what else runs on the machine does not count.
_PROCESSOR = SimpleNamespace(perf_counter=time.process_time)
_SLOW_RUNS = 3
_FAST_RUNS = 15


def _frame_times(case: Case, runs: int) -> None:
    """Whole frames and OpenCV's default detection by turns."""
    gray = cv2.cvtColor(case.frame.rgb, cv2.COLOR_RGB2GRAY)
    detect = default_haar()
    laps: dict[str, list[float]] = {}
    haar: list[float] = []
    for _ in range(5):
        reconstruct(case.frame)
    settled = resident_mb()
    for _ in range(runs):
        with patch.object(pipeline, "time", _PROCESSOR):
            timings = reconstruct(case.frame).report.timings_ms
        for name, ms in timings.items():
            laps.setdefault(name, []).append(ms)
        haar.append(milliseconds(lambda: detect(gray)))
    print(f"\nWhole frame ({case.name}, preset `best`, {len(case.seeds):,} seeds, "
          f"{len(case.queries):,} coloured points with normals), {runs} runs by turns with "
          "OpenCV's default Haar pass on the same image, processor's time:\n")
    print("| stage | median, ms | p99, ms |\n| --- | --- | --- |")
    for name, taken in laps.items():
        print(f"| {name} | {statistics.median(taken):.1f} | {np.percentile(taken, 99):.1f} |")
    print(f"| OpenCV `detectMultiScale`, defaults, {gray.shape[1]}x{gray.shape[0]} "
          f"| {statistics.median(haar):.1f} | {np.percentile(haar, 99):.1f} |")
    total = statistics.median(laps["total"])
    print(f"\nRatio of the medians, frame to Haar: {total / statistics.median(haar):.2f} "
          f"(goal 0.20); p99 to median: {np.percentile(laps['total'], 99) / total:.1f} "
          f"(goal 1.5).")
    held = resident_mb()
    extra = extra_memory(lambda: reconstruct(case.frame))
    print(f"\nExtra memory for one frame: {extra.arrays:.1f} MiB of arrays (tracemalloc), "
          f"{extra.resident:.1f} MiB of the resident set (goal 32). Resident set {settled:.0f} MiB "
          f"before these runs, {held:.0f} after.")


def _grid(case: Case) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    low, high = case.queries.min(axis=0), case.queries.max(axis=0)
    step = case.face.dense.grid_step_mm
    return (np.arange(low[0], high[0] + step, step), np.arange(low[1], high[1] + step, step))


def _fit_times(case: Case, pcl: Pcl | None) -> None:
    """One fit and its evaluation, and the whole of ours, against others, by turns."""
    xs, ys = _grid(case)
    seeds, spacing = case.seeds, case.spacing
    sampler = partial(sample_colors, case.frame, register(case.frame))
    calls: dict[str, Callable[[], float]] = {
        **{f"ours, `{preset.value}`: its fit {_of_fit(case, preset)} and evaluation": partial(
            milliseconds, partial(_fitted, case, preset, xs, ys))
           for preset in (Preset.BEST, Preset.FAITHFUL)},
        "ours, `best`: fit, detail, evaluation with slopes": lambda: milliseconds(
            lambda: surface_of(seeds.astype(np.float32), spacing, Settings(),
                               _plan(case, Preset.BEST), sampler).sampled(xs, ys)),
        **{f"ours, `{preset.value}`, all after segmentation: spacing, fit, normals, colours, sigma":
           partial(milliseconds, after_segmentation(case, with_preset(preset)))
           for preset in (Preset.BEST, Preset.FAITHFUL)},
        "OpenCV inpaint + Gaussian + bicubic": lambda: milliseconds(
            lambda: inpaint_points(case, _SIGMA_PX)),
    }
    if pcl is not None:
        calls[f"PCL MovingLeastSquares, radius {_PCL_RADIUS_MM:g} mm"] = lambda: pcl.run(
            seeds, case.spacing, _PCL_RADIUS_MM)[1]
    slow = {"scipy RBFInterpolator, 50 neighbours": lambda: milliseconds(
        lambda: rbf_points(case, 50))}
    taken: dict[str, list[float]] = {name: [] for name in (calls | slow)}
    for run in range(_FAST_RUNS):
        for name, call in calls.items():
            taken[name].append(call())
        if run < _SLOW_RUNS:
            for name, call in slow.items():
                taken[name].append(call())
    print(f"\nFit and evaluation ({case.name}, {len(seeds):,} seeds, {len(case.queries):,} "
          f"points), medians of {_FAST_RUNS} runs by turns ({_SLOW_RUNS} of scipy):\n")
    medians = {name: statistics.median(ms) for name, ms in taken.items()}
    # Fit, and fit with detail, of `best`; all of it.
    own = [list(medians.values())[at] for at in (0, 2, 3)]
    print("| | ms | over the fit of `best` | over its fit and detail | over all of it |\n"
          "| --- | --- | --- | --- | --- |")
    for name, ms in medians.items():
        print(f"| {name} | {ms:,.1f} | " + " | ".join(f"{ms / one:,.2f}" for one in own) + " |")


def _plan(case: Case, preset: Preset) -> Risk:
    seeds = case.face.initial.points
    noise = measure_noise(seeds, case.seed_pixels.astype(np.int32), case.spacing)
    return plan_fit(Settings.of(preset), noise, case.spacing)


def _of_fit(case: Case, preset: Preset) -> str:
    plan = _plan(case, preset)
    return f"(R0 = {plan.r0_factor:.3g}h, lambda = {plan.smoothing:.3g})"


def _fitted(
    case: Case, preset: Preset, xs: NDArray[np.float64], ys: NDArray[np.float64]
) -> NDArray[np.float32]:
    plan = _plan(case, preset)
    return fit_surface(case.seeds, plan.r0_factor * case.spacing, plan.smoothing).heights(xs, ys)


def _against_dense(case: Case, count: int, preset: Preset) -> None:
    """The same system with one unknown for each seed, for so many seeds as it can bear."""
    plan = _plan(case, preset)
    away = np.linalg.norm(case.seeds[:, :2] - np.median(case.seeds[:, :2], axis=0), axis=1)
    chosen = np.argsort(away)[:count]
    seeds, r0 = case.seeds[chosen], plan.r0_factor * case.spacing
    low, high = seeds[:, :2].min(axis=0), seeds[:, :2].max(axis=0)
    side = int(np.sqrt(10 * len(seeds)))
    xs, ys = np.linspace(low[0], high[0], side), np.linspace(low[1], high[1], side)
    queries = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    inside = np.linalg.norm(queries - np.median(case.seeds[:, :2], axis=0), axis=1) < (
        away[chosen].max())
    results: dict[str, Any] = {}

    def fast() -> None:
        results["fast"] = fit_surface(seeds, r0, plan.smoothing).heights(xs, ys).ravel()

    def dense() -> None:
        results["dense"] = dense_heights(seeds, queries, r0, plan.smoothing)

    fast()
    times: list[tuple[float, float]] = []
    for _ in range(_SLOW_RUNS):
        slow = milliseconds(dense)
        times.append((statistics.median(milliseconds(fast) for _ in range(5)), slow))
    ours, dense_ms = (statistics.median(column) for column in zip(*times, strict=True))
    off = np.abs(results["fast"] - results["dense"])[inside]
    print(f"\nThe system of `{preset.value}` {_of_fit(case, preset)} for the middle "
          f"{len(seeds):,} seeds, {len(queries):,} points: dense solve {dense_ms:,.0f} ms, ours "
          f"{ours:.1f} ms, {dense_ms / ours:,.0f} times faster (goal 1000, for all seeds); largest "
          f"deviation {off.max():.4f} mm (goal 0.01).")


def main() -> int:
    """Print the tables; draw the growth where asked."""
    parser = argparse.ArgumentParser(prog="script/bench speed", description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="whole frames (100)")
    parser.add_argument("--dense-seeds", type=int, default=3000, metavar="N",
                        help="seeds for the dense solve, whose time grows with their cube (3000)")
    add_flags(parser)
    args = parser.parse_args()
    if args.dense_seeds < MIN_SEEDS:
        parser.error(f"--dense-seeds must be at least {MIN_SEEDS}, got {args.dense_seeds}")
    if args.runs < 1:
        parser.error(f"--runs must be at least 1, got {args.runs}")
    check_flags(parser, args)
    cv2.setNumThreads(1)
    pcl = open_pcl(args)
    print(describe("script/bench speed " + " ".join(sys.argv[1:]),
                   *([f"PCL {pcl.version}"] if pcl else [])))
    cases = {case.name: case for case in recorded(1)}
    warm()  # as a worker is before its first frame
    for name in (_OF, _GOAL_OF):
        _frame_times(cases[name], args.runs)
    case = cases[_OF]
    _fit_times(case, pcl)
    for preset in (Preset.BEST, Preset.FAITHFUL):
        _against_dense(case, args.dense_seeds, preset)
    growth(pcl, args.pictures)
    return 0


if __name__ == "__main__":
    sys.exit(main())
