"""What `denseface compare` finds: implanted changes, and repeats without one.

A cheek of a simulated head is raised by a smooth bump; before and after are captures with other
noise and other poses, some degrees and centimetres apart. A capture is a burst of frames. A change
is found where a region of its sign has its peak within 15 mm of the bump's middle; a false alarm is
any region at all between captures of the unchanged head. Pairs are drawn from one pool of captures
for each head, so they are not all independent.
"""

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.heads import REPORTING, at_hand
from bench.machine import describe
from denseface.capture.burst import fuse
from denseface.capture.calibration import CameraModel
from denseface.recon import Settings, reconstruct
from denseface.service.tools.comparison.comparing import Comparison, LaidOn
from denseface.service.tools.comparison.surface import Surface
from tests.simulator import KinectModel, Person, Raised, Scene, load_head, simulate
from tests.simulator.sensors import SENSORS

__all__: list[str] = []

_HEADS = REPORTING[2:]
"""The factors of the threshold were raised after the first two had been seen."""
_HEIGHTS_MM, _WIDTHS_MM = (0.25, 0.5, 1.0), (15.0, 20.0, 30.0)
_X_MM = 38.0
"""How far from the middle of the face the bump is."""
_BURST = 4
_SETTINGS = ((1, 1), (1, _BURST), (4, _BURST), (16, _BURST))
"""Captures of each side, frames of each capture."""
_BASE, _CHANGED, _DRAWS = 12, 6, 3
"""Poses of the unchanged head and of each changed one, and captures in each pose."""
_NULLS, _PAIRS = 8, 3
"""Pairs for each setting: of repeats, for each head; of each change."""
_NEAR_MM = 15.0
_CUT_PX, _CUT_COLOR_PX = 300, 400
"""Images are cut to the head: what is beside it costs time and changes nothing."""


def _cut(sensor: KinectModel) -> KinectModel:
    def cut(camera: CameraModel, most: int) -> CameraModel:
        side = min(most, camera.height)
        return camera.model_copy(update={
            "width": side, "height": side, "cx": camera.cx - (camera.width - side) // 2,
            "cy": camera.cy - (camera.height - side) // 2})

    cameras = sensor.calibration
    return replace(sensor, name=f"{sensor.name}, cut", calibration=cameras.model_copy(update={
        "depth": cut(cameras.depth, _CUT_PX), "color": cut(cameras.color, _CUT_COLOR_PX)}))


def _people(head: str, count: int, seed: int) -> Iterator[Person]:
    rng = np.random.default_rng([71, seed])
    for _ in range(count):
        yield Person(head, rng.uniform(650, 750), yaw=rng.uniform(-6, 6),
                     pitch=rng.uniform(-4, 4), roll=rng.uniform(-3, 3),
                     offset_mm=(rng.uniform(-20, 20), rng.uniform(-15, 15)), shoulders=False)


@dataclass(frozen=True)
class _Pool:
    """Captures of a head in some poses: by frames of each, rows of a `LaidOn`, (poses, draws)."""

    rows: dict[int, NDArray[np.int64]]

    def some(self, rng: np.random.Generator, captures: int, frames: int,
             poses: slice = slice(None)) -> list[int]:
        """Draw captures, from as many poses as there are."""
        rows = self.rows[frames][poses]
        order = rng.permuted(rows, axis=1)[rng.permutation(len(rows))].T.ravel()
        return [int(row) for row in order[:captures]]


def _captures(
    sensor: KinectModel, head: str, poses: int, seed: int, surfaces: list[Surface]
) -> tuple[_Pool, Person]:
    """Take captures of a head, add them to the surfaces, and give the first pose."""
    rows: dict[int, list[list[int]]] = {frames: [] for frames in {n for _, n in _SETTINGS}}
    people = list(_people(head, poses, seed))
    for pose, person in enumerate(people):
        scene = Scene((person,), wall_mm=1500.0, holes=0.1)
        for found in rows.values():
            found.append([])
        for draw in range(_DRAWS):
            shots = simulate(scene, sensor, 10_000 * seed + 10 * pose + draw, _BURST)
            for frames, found in rows.items():
                if frames < _BURST and draw:
                    continue
                face = reconstruct(fuse([shot.frame for shot in shots[:frames]]),
                                   Settings(ratio=5))
                found[-1].append(len(surfaces))
                surfaces.append(Surface.of_face(face))
    return _Pool({frames: np.array(found) for frames, found in rows.items()}), people[0]


def _place(head: str, bump: Raised, person: Person) -> NDArray[np.float64]:
    """Give where the middle of a bump is in the camera's frame of a pose, (3,) mm."""
    # The foremost surface there: scans have others behind the skin, and few vertices on cheeks.
    shape, middle = load_head(head), np.array([bump.x, bump.y])
    corners = shape.vertices[shape.faces].astype(float)
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    across, flat = middle - a[:, :2], np.abs(area) < 1e-9
    area = np.where(flat, 1.0, area)
    v = (across[:, 0] * ac[:, 1] - across[:, 1] * ac[:, 0]) / area
    w = (ab[:, 0] * across[:, 1] - ab[:, 1] * across[:, 0]) / area
    within = ~flat & (v >= 0) & (w >= 0) & (v + w <= 1)
    z = (a[:, 2] + v * ab[:, 2] + w * ac[:, 2])[within].min()
    return np.asarray(person.rotation @ np.array([*middle, z]) + person.shift, np.float64)


@dataclass
class _Tally:
    tried: int = 0
    found: int = 0
    elsewhere: int = 0
    finds_mm: float = 0.0

    def add(self, result: Comparison, sign: float = 0.0, at: NDArray[np.float64] | None = None
            ) -> None:
        verdict = result.verdict
        assert verdict is not None  # noqa: S101
        self.tried += 1
        self.finds_mm += verdict.finds_mm
        near = [at is not None and sign * change.mean_mm > 0
                and bool(np.linalg.norm(result.sites.points[change.peak] - at) < _NEAR_MM)
                for change in verdict.changes]
        self.found += any(near)
        self.elsewhere += not all(near)


def _rows(sensor: KinectModel, heads: Sequence[str], some: range) -> Iterator[str]:
    """Give the rows of a sensor; of some of the heads, by number, alone."""
    repeats = {setting: _Tally() for setting in _SETTINGS}
    found = {(height, width, setting): _Tally() for height in _HEIGHTS_MM for width in _WIDTHS_MM
             for setting in _SETTINGS}
    for index in some:
        head, rng = heads[index], np.random.default_rng([5, index])
        marks = load_head(head).landmarks
        level = (marks.nose_tip[0] + marks.mouth[0]) / 2
        surfaces: list[Surface] = []
        base, first = _captures(sensor, head, _BASE, 3 + 40 * index, surfaces)
        pools = {}
        for number, (height, width) in enumerate(
                (height, width) for height in _HEIGHTS_MM for width in _WIDTHS_MM):
            if number % len(heads) == index:
                bump = Raised(height, width, _X_MM * (-1) ** (number // 2), level)
                pools[height, width] = bump, _captures(
                    sensor, f"{head}+{bump}", _CHANGED, 4 + 40 * index + number, surfaces)[0]
        print(f"{sensor.name}, {head}: {len(surfaces)} captures", file=sys.stderr, flush=True)
        laid = LaidOn.of(surfaces, [f"{head} {row}" for row in range(len(surfaces))])
        for setting in _SETTINGS:
            for _ in range(_NULLS):
                half = _BASE // 2
                repeats[setting].add(laid.compare(base.some(rng, *setting, slice(half)),
                                                  base.some(rng, *setting, slice(half, None))))
            for (height, width), (bump, pool) in pools.items():
                at = _place(head, bump, first)
                for _ in range(_PAIRS):
                    found[height, width, setting].add(
                        laid.compare(base.some(rng, *setting), pool.some(rng, *setting)),
                        np.sign(height), at)
            print(f"{sensor.name}, {head}: {setting} done", file=sys.stderr, flush=True)
    yield from _table(sensor.name.removesuffix(", cut"), repeats, found)


def _table(
    sensor: str, repeats: dict[tuple[int, int], _Tally],
    found: dict[tuple[float, float, tuple[int, int]], _Tally],
) -> Iterator[str]:
    for setting, tally in repeats.items():
        captures, frames = setting
        cells = []
        for height in _HEIGHTS_MM:
            one = [found[height, width, setting] for width in _WIDTHS_MM]
            cells.append(", ".join(f"{each.found}/{each.tried}" for each in one))
        others = sum(each.elsewhere for (_, _, other), each in found.items() if other == setting)
        tried = sum(each.tried for (_, _, other), each in found.items() if other == setting)
        yield (f"| {sensor} | {captures} x {frames} | {tally.finds_mm / tally.tried:.2f} | "
               + " | ".join(cells) + f" | {tally.elsewhere}/{tally.tried} | {others}/{tried} |")


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench compare", description=__doc__)
    parser.add_argument("--sensor", action="append", choices=list(SENSORS), metavar="NAME",
                        help="may be repeated (default: kinect v1, time of flight)")
    parser.add_argument("--head", action="append", metavar="NAME",
                        help="may be repeated; changes are shared out among them (default: "
                             f"{', '.join(_HEADS)})")
    parser.add_argument("--only", type=int, metavar="N",
                        help="the share of the N-th of these heads alone, from 0")
    args = parser.parse_args()
    heads = at_hand(tuple(args.head or _HEADS))
    some = range(len(heads)) if args.only is None else range(args.only, args.only + 1)
    print(describe(" ".join(["script/bench compare", *sys.argv[1:]])))
    print(f"\nHeads {', '.join(heads)}; 95 % confidence; found of tried, at 15, 20, 30 mm width:\n")
    print("| sensor | captures x frames a side | finds 20 mm wide from, mm | "
          + " | ".join(f"{height} mm" for height in _HEIGHTS_MM)
          + " | false alarms: repeats | beside a change |")
    print("|" + " --- |" * (5 + len(_HEIGHTS_MM)), flush=True)
    for name in args.sensor or ("kinect v1", "time of flight"):
        for row in _rows(_cut(SENSORS[name]), heads, some):
            print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
