"""Error over heads, distances and turns in one run, peers on some of the frames beside ours."""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.cases import Case, posed
from bench.heads import CHOOSING, REPORTING, at_hand
from bench.machine import describe
from bench.pcl_peer import Pcl, PclMissingError
from bench.peer_methods import inpaint_points, poisson_points, rbf_points
from denseface.recon import Preset
from denseface.service.tools.evaluation.paper import GROSS_MM
from tests.simulator.accuracy import NEAR_MM

__all__ = ["Band", "bands"]

_DISTANCES_MM = (600, 700, 800, 900, 1000, 1100)
_YAWS = (-20, -10, 0, 10, 20)
_HOLES = (0.25, 1.0)
"""`Scene.holes` by turns: traces at eyes and nostrils, large patches."""
_SIGMA_PX = 2.0
"""Standard deviation of OpenCV's Gaussian, pixels."""
_RADIUS_MM = 18.0
"""Radius of PCL's moving least squares, mm."""
_MIN_FILLED = 0.5
"""With a smaller part of its points filled, a hole's error says nothing."""
_HEADINGS = ("frames", "mean, mm", "SD, mm", "> 5.5 mm, %", "face within 2 mm, %",
             "worst frame, %", "inside holes, mm")


@dataclass
class Band:
    """Errors of one method over the frames of a band.

    A frame counts once in each figure, a point once inside holes.
    """

    means: list[float] = field(default_factory=list)
    squares: list[float] = field(default_factory=list)
    gross: list[float] = field(default_factory=list)
    covered: list[float] = field(default_factory=list)
    hole_sum: float = 0.0
    hole_points: int = 0
    hole_places: int = 0

    def add(self, errors: NDArray[np.float64], hole: NDArray[np.bool_], covered: float) -> None:
        """Count one frame.

        Parameters
        ----------
        errors : (m,) float64, mm, NaN where the method gives no point
        hole : (m,) bool, which of them are inside holes
        covered : share of the true visible face within 2 mm of a point
        """
        known = np.isfinite(errors)
        self.means.append(float(errors[known].mean()))
        self.squares.append(float((errors[known] ** 2).mean()))
        self.gross.append(float((errors[known] > GROSS_MM).mean()))
        self.covered.append(covered)
        self.hole_sum += float(errors[known & hole].sum())
        self.hole_points += int((known & hole).sum())
        self.hole_places += int(hole.sum())

    def row(self, name: str) -> str:
        """Give the table's row."""
        if not self.means:
            return f"| {name} | 0 |" + " - |" * (len(_HEADINGS) - 1)
        mean = float(np.mean(self.means))
        spread = float(np.sqrt(max(np.mean(self.squares) - mean**2, 0.0)))
        filled = self.hole_points > _MIN_FILLED * self.hole_places
        hole = f"{self.hole_sum / self.hole_points:.2f}" if filled else "-"
        return (f"| {name} | {len(self.means)} | {mean:.2f} | {spread:.2f} "
                f"| {100 * np.mean(self.gross):.2f} | {100 * np.mean(self.covered):.1f} "
                f"| {100 * min(self.covered):.1f} | {hole} |")


def bands(edges: tuple[int, ...], unit: str) -> dict[str, tuple[int, int]]:
    """Name what lies between neighbouring edges."""
    return {f"{low} to {high} {unit}": (low, high)
            for low, high in pairwise(edges)}


def _cases(
    heads: list[str], each: int, seeds: int, preset: Preset
) -> Iterator[tuple[Case, float, float]]:
    """Frames of `each` heads for each band of distance, band of turn and seed, in the bands."""
    index = 0
    for seed in range(seeds):
        for i, (low, high) in enumerate(pairwise(_DISTANCES_MM)):
            for j, (left, right) in enumerate(pairwise(_YAWS)):
                for k in range(each):
                    rng = np.random.default_rng([17, seed, index])
                    distance, yaw = rng.uniform(low, high), rng.uniform(left, right)
                    head = heads[(i + j + k + seed) % len(heads)]
                    holes = _HOLES[(i + j // 2 + seed) % len(_HOLES)]
                    case = posed(head, distance, yaw, holes, 100 + index, preset, beyond=True)
                    index += 1
                    if case is not None:
                        yield case, distance, yaw


def _measure(case: Case, points: NDArray[np.floating]) -> tuple[NDArray[np.float64], float]:
    known = points[np.isfinite(points).all(axis=1)]
    nearest, _ = cKDTree(known).query(case.truth.face_points(), distance_upper_bound=NEAR_MM)
    return case.errors(points), float(np.isfinite(nearest).mean())


def _peers(case: Case, pcl: Pcl | None) -> Iterator[tuple[str, NDArray[np.float64]]]:
    yield (f"OpenCV inpaint + Gaussian + bicubic, sigma {_SIGMA_PX} px",
           inpaint_points(case, _SIGMA_PX))
    yield "scipy RBFInterpolator, 50 neighbours", rbf_points(case, 50)
    for depth in (5, 6):
        yield f"Open3D Poisson, depth {depth}", poisson_points(case, depth)
    if pcl is not None:
        yield (f"PCL MovingLeastSquares, radius {_RADIUS_MM:g} mm",
               pcl.points(case, _RADIUS_MM)[0])


def _print_table(title: str, rows: dict[str, Band]) -> None:
    print(f"\n| {title} | " + " | ".join(_HEADINGS) + " |")
    print("|" + " --- |" * (len(_HEADINGS) + 1))
    for name, band in rows.items():
        print(band.row(name), flush=True)


def main() -> int:
    """Print the tables by distance, by turn, by head, and against peers."""
    parser = argparse.ArgumentParser(prog="script/bench sweep", description=__doc__)
    parser.add_argument("--seeds", type=int, default=1,
                        help="frames for each head, distance and turn (1)")
    parser.add_argument("--heads", type=int, metavar="N",
                        help="N of the heads for each distance and turn, in turn (all)")
    parser.add_argument("--on", choices=("reporting", "choosing"), default="reporting",
                        help="heads of the tables, or those to choose settings on (reporting)")
    parser.add_argument("--preset", type=Preset, default=Preset.BEST, choices=list(Preset),
                        metavar="NAME", help="preset to measure (best)")
    parser.add_argument("--peers-every", type=int, default=3, metavar="N",
                        help="peers on every N-th frame, 0 for none (3)")
    args = parser.parse_args()
    if args.seeds < 1 or args.peers_every < 0 or (args.heads is not None and args.heads < 1):
        parser.error("--seeds and --heads must be positive, --peers-every not negative")
    cv2.setNumThreads(1)
    try:
        pcl = Pcl(install=False)
    except PclMissingError as missing:
        print(f"PCL is left out: {missing}", file=sys.stderr)
        pcl = None
    print(describe("script/bench sweep " + " ".join(sys.argv[1:])))
    heads = at_hand(CHOOSING if args.on == "choosing" else REPORTING)
    ours = f"ours, `{args.preset}`"
    near, turned = bands(_DISTANCES_MM, "mm"), bands(_YAWS, "degrees")
    by_distance = {name: Band() for name in [*near, "all"]}
    by_turn, by_head = ({name: Band() for name in names} for names in (turned, heads))
    raw, peers = Band(), {ours: Band()}
    for index, (case, distance, yaw) in enumerate(
            _cases(heads, min(args.heads or len(heads), len(heads)), args.seeds, args.preset)):
        errors, covered = _measure(case, case.face.dense.points)
        chosen = [by_distance["all"], by_head[case.name.split()[0]]]
        chosen += [by_distance[n] for n, (low, high) in near.items() if low <= distance < high]
        chosen += [by_turn[n] for n, (low, high) in turned.items() if low <= yaw < high]
        for band in chosen:
            band.add(errors, case.hole, covered)
        found, seen = _measure(case, case.seeds)
        raw.add(found, np.zeros(len(found), bool), seen)
        if args.peers_every and index % args.peers_every == 0:
            peers[ours].add(errors, case.hole, covered)
            for name, points in _peers(case, pcl):
                found, seen = _measure(case, points)
                peers.setdefault(name, Band()).add(found, case.hole, seen)
        print(f"{case.name}: {np.nanmean(errors):.2f} mm", file=sys.stderr, flush=True)
    _print_table(f"distance, `{args.preset}`", by_distance | {"raw seeds (the sensor)": raw})
    _print_table(f"turn, `{args.preset}`", by_turn)
    _print_table(f"head, `{args.preset}`", by_head)
    if args.peers_every:
        _print_table(f"every {args.peers_every}. frame", peers)
    return 0


if __name__ == "__main__":
    sys.exit(main())
