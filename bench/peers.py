"""Our faces against what others make of the same seeds, on frames whose true surface is known."""

import argparse
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.cases import Case, recorded, simulated, with_preset
from bench.error_summary import HEADINGS, ErrorSummary
from bench.flags import add_flags, check_flags, open_pcl
from bench.literal import exact_interpolation
from bench.machine import describe
from bench.pcl_peer import Pcl
from bench.peer_methods import griddata_points, inpaint_points, poisson_points, rbf_points
from denseface.recon import Preset, reconstruct

__all__: list[str] = []

Result = tuple[NDArray[np.float64], float]
"""Points, (m, 3) mm, one for each query, and the milliseconds that they took."""

_SIGMAS_PX = (1.5, 2.0, 2.5)
_PCL_RADII_MM = (10.0, 15.0, 18.0, 22.0)
_PATCH = 1400
_RIDGES = (0.0, 0.1)
_MAP_OF = "many_holes/0"
_UNMAPPED = ("scipy griddata, cubic", "Open3D Poisson, depth 6", "Open3D Poisson, depth 8")
_BEFORE_FIT = ("overview", "detection", "registration", "segmentation", "total")


@dataclass(frozen=True)
class _Method:
    """A peer, tried with several settings: of these the best mean is shown, a favour to it."""

    name: str
    variants: dict[str, Callable[[Case], Result]]


def _ours_ms(timings: dict[str, float]) -> float:
    """Sum what follows segmentation: spacing, fit, evaluation, normals, colours."""
    return sum(ms for name, ms in timings.items() if name not in _BEFORE_FIT)


def _timed(function: Callable[[Case], NDArray[np.float64]], case: Case) -> Result:
    start = time.perf_counter()
    points = function(case)
    return points, (time.perf_counter() - start) * 1e3


def _ours(preset: Preset, case: Case) -> Result:
    """A preset's own grid is not that of `best`: its points are carried along their tangents."""
    face = reconstruct(case.frame, with_preset(preset))
    points, normals = (one.astype(np.float64) for one in (face.dense.points, face.dense.normals))
    away, nearest = cKDTree(points[:, :2]).query(case.queries)
    step, n = case.queries - points[nearest, :2], normals[nearest]
    z = points[nearest, 2] - (step * n[:, :2]).sum(axis=1) / n[:, 2]
    z[away > face.dense.grid_step_mm] = np.nan
    return case.at(z), _ours_ms(face.report.timings_ms)


def _methods(pcl: Pcl | None, *, more: bool) -> Iterator[_Method]:
    yield _Method("OpenCV inpaint + Gaussian + bicubic", {
        f"sigma {sigma} px": partial(_timed, partial(inpaint_points, sigma=sigma))
        for sigma in _SIGMAS_PX})
    for neighbors in (20, 50, 100) if more else (50,):
        yield _Method(f"scipy RBFInterpolator, {neighbors} neighbours", {
            "": partial(_timed, partial(rbf_points, neighbors=neighbors))})
    yield _Method("scipy griddata, linear",
                  {"": partial(_timed, partial(griddata_points, method="linear"))})
    yield _Method("scipy griddata, cubic",
                  {"": partial(_timed, partial(griddata_points, method="cubic"))})
    for depth in (5, 6, 8):
        yield _Method(f"Open3D Poisson, depth {depth}",
                      {"": partial(_timed, partial(poisson_points, depth=depth))})
    if pcl is not None:
        yield _Method("PCL MovingLeastSquares, order 2 (no colour)", {
            f"radius {radius:g} mm": partial(pcl.points, radius=radius)
            for radius in _PCL_RADII_MM})
    for preset in Preset:
        yield _Method(f"ours, `{preset.value}`", {"": partial(_ours, preset)})


def _run(cases: Iterable[Case], methods: list[_Method]) -> tuple[
        dict[str, list[ErrorSummary]], dict[str, NDArray[np.float64]], Case | None, int]:
    """Every method on every frame, by turns: summaries, error map of one frame, frames."""
    summaries = {m.name: [ErrorSummary(f"{m.name}, {v}" if v else m.name) for v in m.variants]
                 for m in methods}
    raw = ErrorSummary("raw seeds (the sensor)")
    maps: dict[str, NDArray[np.float64]] = {}
    mapped: Case | None = None
    count = 0
    for case in cases:
        count += 1
        ours = case.errors(case.face.dense.points)
        errors = case.errors(case.seeds)
        raw.add(errors, np.zeros(len(errors), bool), None, 0.0)
        chosen = case.name == _MAP_OF or mapped is None
        mapped = case if chosen else mapped
        for method in methods:
            for summary, run in zip(summaries[method.name], method.variants.values(), strict=True):
                points, took = run(case)
                errors = case.errors(points)
                summary.add(errors, case.hole, ours, took)
                if chosen:
                    maps[summary.name] = errors
        print(f"{case.name}: {len(case.seeds):,} seeds, {len(ours):,} places, "
              f"{case.hole.sum():,} in holes", file=sys.stderr, flush=True)
    return {raw.name: [raw], **summaries}, maps, mapped, count


def _print_table(summaries: list[ErrorSummary]) -> None:
    print("| " + " | ".join(HEADINGS) + " |")
    print("|" + " --- |" * len(HEADINGS))
    for summary in summaries:
        print(summary.row(), flush=True)


def _print_literal(case: Case) -> None:
    print(f"\nThe paper's literal form, the middle {_PATCH:,} seeds of {case.name}, R0 = 6 "
          "spacings:\n")
    print("| added to the diagonal | condition number | Cholesky | off the seeds by, mm "
          "| mean error, mm | largest, mm |")
    print("|" + " --- |" * 6)
    for ridge in _RIDGES:
        found = exact_interpolation(case, _PATCH, ridge)
        print(f"| {ridge:g} | {found.condition:.1e} | {'works' if found.cholesky else 'fails'} "
              f"| {found.at_seeds_mm:,.2f} | {found.mean_mm:,.2f} | {found.largest_mm:,.1f} |")


def main() -> int:
    """Print the tables; draw the pictures where asked."""
    parser = argparse.ArgumentParser(prog="script/bench peers", description=__doc__)
    parser.add_argument("--frames", type=int, default=3, help="of each recording (3)")
    parser.add_argument("--simulated", type=int, default=0, metavar="N",
                        help="N frames of heads with many holes besides (0)")
    parser.add_argument("--more", action="store_true",
                        help="scipy with 20 and 100 neighbours as well (slow)")
    add_flags(parser)
    args = parser.parse_args()
    if args.frames < 0 or args.simulated < 0 or args.frames + args.simulated == 0:
        parser.error("--frames and --simulated must not be negative, and not both 0")
    check_flags(parser, args)
    cv2.setNumThreads(1)
    pcl = open_pcl(args)
    methods = list(_methods(pcl, more=args.more))
    print(describe("script/bench peers " + " ".join(sys.argv[1:]),
                   *([f"PCL {pcl.version}"] if pcl else [])))
    for what, cases in (("recordings", recorded(args.frames)),
                        ("simulated heads", simulated(args.simulated))):
        found, maps, mapped, count = _run(cases, methods)
        if mapped is None:
            continue
        best = [min(variants, key=lambda t: t.mean_mm) for variants in found.values()]
        print(f"\n{count} frames ({what}), {best[-1].hole_places:,} places inside holes:\n")
        _print_table(best)
        if what == "recordings":
            _print_literal(mapped)
            if args.pictures:
                from bench.figures import error_histogram, error_maps

                error_maps(mapped, {t.name: maps[t.name] for t in best[1:]
                                    if t.name not in _UNMAPPED},
                           args.pictures / "error_maps.png")
                error_histogram(best, args.pictures / "error_histogram.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
