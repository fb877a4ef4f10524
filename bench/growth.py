"""Time against the number of seeds: the same head before sensors of other resolutions."""

import statistics
from collections.abc import Callable
from functools import partial
from pathlib import Path

from bench.cases import Case, with_preset
from bench.dense_solve import dense_heights
from bench.own import after_segmentation, milliseconds
from bench.pcl_peer import Pcl
from bench.peer_methods import griddata_points, inpaint_points, poisson_points, rbf_points
from denseface.recon import Preset, reconstruct
from tests.simulator import KINECT_DEFAULT, KinectModel, Person, Scene, simulate

__all__ = ["growth"]

# Of the depth camera's resolution: about 3,000, 10,000, 30,000 and 100,000 seeds.
_SCALES = (0.48, 0.86, 1.47, 2.68)
_RUNS = 7
# What takes longer is run once.
_SLOW_MS = 1000.0
_DISTANCE_MM = 750.0
# What takes longer than some 20 s is left out above so many seeds.
_MOST_SCIPY = 15_000
_MOST_DENSE = 4_000
_PCL_SPACINGS = 8.0
_OURS = "ours, all after segmentation"
_FRAME = "ours, whole frame"


def growth(pcl: Pcl | None, pictures: Path | None) -> None:
    """Print the table, and draw it where asked."""
    times: dict[str, list[tuple[int, float]]] = {}
    settings = with_preset(Preset.BEST)
    for scale in _SCALES:
        case = _case(scale)
        rest = after_segmentation(case, settings)
        ours: list[float] = []
        frame: list[float] = []
        others = _others(case, pcl)
        taken: dict[str, list[float]] = {name: [] for name in others}
        for _ in range(_RUNS):
            ours.append(milliseconds(rest))
            frame.append(milliseconds(partial(reconstruct, case.frame, settings)))
            for name, call in others.items():
                if not taken[name] or max(taken[name]) < _SLOW_MS:
                    taken[name].append(call(case))
        for name, all_ms in ({_OURS: ours, _FRAME: frame} | taken).items():
            times.setdefault(name, []).append((len(case.seeds), statistics.median(all_ms)))
    _print(times)
    if pictures is not None:
        from bench.figures import time_against_seeds

        time_against_seeds(times, pictures / "time_against_seeds.png")


def _case(scale: float) -> Case:
    own = KINECT_DEFAULT.calibration
    sensor = KinectModel(
        name=f"x {scale:g}", projector_mm=KINECT_DEFAULT.projector_mm,
        calibration=own.model_copy(update={"depth": own.depth.scaled(scale)}))
    shot, = simulate(Scene((Person("procedural", _DISTANCE_MM),)), sensor, seed=1)
    return Case(sensor.name, shot.frame, shot.truth,
                reconstruct(shot.frame, with_preset(Preset.BEST)))


def _others(case: Case, pcl: Pcl | None) -> dict[str, Callable[[Case], float]]:
    count = len(case.seeds)
    found: dict[str, Callable[[Case], float]] = {
        "OpenCV inpaint + Gaussian + bicubic": _timed(lambda c: inpaint_points(c, 2.0)),
        "scipy griddata, linear": _timed(lambda c: griddata_points(c, "linear")),
        "Open3D Poisson, depth 6": _timed(lambda c: poisson_points(c, 6)),
    }
    if pcl is not None:
        found["PCL MovingLeastSquares, 8 spacings"] = lambda c: pcl.run(
            c.seeds, c.spacing, _PCL_SPACINGS * c.spacing)[1]
    if count <= _MOST_SCIPY:
        found["scipy RBFInterpolator, 50 neighbours"] = _timed(
            lambda c: rbf_points(c, 50))
    if count <= _MOST_DENSE:
        found["dense solve of our system"] = _timed(
            lambda c: dense_heights(c.seeds, c.queries, 6 * c.spacing, 3.0))
    return found


def _timed(function: Callable[[Case], object]) -> Callable[[Case], float]:
    return lambda case: milliseconds(lambda: function(case))


def _print(times: dict[str, list[tuple[int, float]]]) -> None:
    counts = [seeds for seeds, _ in times[_OURS]]
    print("\nTime against seeds, ms (the procedural head before depth cameras of other "
          f"resolutions; medians of {_RUNS} runs by turns, of one where it takes over "
          f"{_SLOW_MS / 1000:g} s):\n")
    print("| seeds | " + " | ".join(f"{count:,}" for count in counts) + " | last / second |")
    print("|" + " --- |" * (len(counts) + 2))
    for name, pairs in times.items():
        known = dict(pairs)
        cells = [f"{known[count]:,.1f}" if count in known else "-" for count in counts]
        grown = (f"{known[counts[-1]] / known[counts[1]]:.1f}"
                 if counts[-1] in known else "-")
        print(f"| {name} | " + " | ".join(cells) + f" | {grown} |")
    print(f"\n{counts[-1] / counts[1]:.1f} times the seeds from the second to the last (goal: 10 "
          "times the seeds in at most 12 times the time).")
