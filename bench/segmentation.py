"""What segmentation keeps and loses, in scenes made to mislead it."""

import argparse
import statistics
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from bench.heads import CHOOSING, REPORTING
from bench.machine import describe
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.face import Box
from tests.simulator import (
    KINECT_CALIBRATED,
    Accuracy,
    Person,
    Scene,
    Simulated,
    head_names,
    measure,
    simulate,
)
from tests.simulator.heads import load_head

__all__ = ["CASES", "scenes", "shots"]


_DISTANCES_MM = (600.0, 1000.0)
_YAW = 20.0
_GAP_MM = 50.0
# No ear reaches below this, head frame.
_CHIN_MM = 60.0


def _before_wall(person: Person, gap_mm: float) -> Scene:
    """Place a wall so far behind the head's rearmost point."""
    behind = float(load_head(person.head).vertices[:, 2].max())
    return Scene((person,), wall_mm=person.distance_mm + behind + gap_mm)


def _with_other(person: Person, farther_mm: float, aside_mm: float | None = None) -> Scene:
    """Add one to the right, by default so that ear touches ear."""
    other = CHOOSING[2] if person.head not in CHOOSING else REPORTING[3]
    if other not in head_names():
        other = person.head
    if aside_mm is None:
        aside_mm = _half_width(person.head) + _half_width(other)
    return Scene((person, Person(other, person.distance_mm + farther_mm,
                                 offset_mm=(aside_mm, 15.0))))


def _half_width(head: str) -> float:
    """From the middle of a head to the outside of its ears, mm."""
    vertices = load_head(head).vertices
    return float(np.abs(vertices[vertices[:, 1] < _CHIN_MM, 0]).max())


CASES: dict[str, Callable[[Person], Scene]] = {
    "plain": lambda one: Scene((one,)),
    "large holes, hair among them": lambda one: Scene((one,), holes=1.0),
    "face lifted by 20 degrees": lambda one: Scene((replace(one, pitch=20.0),)),
    "face lowered by 20 degrees": lambda one: Scene((replace(one, pitch=-20.0),)),
    "glasses": lambda one: Scene((replace(one, glasses=True),)),
    "hand before chin and cheek": lambda one: Scene((replace(one, hand=True),)),
    "wall 5 cm behind": lambda one: _before_wall(one, _GAP_MM),
    "other head beside, ears touching": lambda one: _with_other(one, 20.0),
    "other head half hidden, 15 cm farther": lambda one: _with_other(one, 150.0, -100.0),
    "rolled by 20 degrees": lambda one: Scene((replace(one, roll=20.0),)),
    "rolled by -20 degrees": lambda one: Scene((replace(one, roll=-20.0),)),
}
"""Each puts one person into a scene."""


def scenes(case: str, heads: tuple[str, ...], distances: tuple[float, ...]) -> Iterator[Scene]:
    """Give a case's scenes: every head at every distance, each turned otherwise."""
    index = 0
    for head in heads:
        for distance in distances:
            yaw = _YAW * np.sin(2.4 * index + len(case))
            scene = CASES[case](Person(head, distance, yaw=float(yaw)))
            yield replace(scene, decor=index)
            index += 1


def shots(case: str, heads: tuple[str, ...], distances: tuple[float, ...]) -> Iterator[Simulated]:
    """Give one frame, with its truth, of each of a case's scenes."""
    for index, scene in enumerate(scenes(case, heads, distances)):
        yield from simulate(scene, KINECT_CALIBRATED, seed=500 + index)


@dataclass
class _Row:
    case: str
    found: list[Accuracy] = field(default_factory=list)
    missed: int = 0

    def add(self, shot: Simulated) -> None:
        try:
            face = reconstruct(shot.frame)
        except ReconstructionError:
            self.missed += 1
            return
        if _on_the_face(face.report.face_box, shot):
            self.found.append(measure(face, shot.truth, shot.frame))
        else:
            self.missed += 1

    def __str__(self) -> str:
        cells = [self.case, f"{len(self.found)} of {len(self.found) + self.missed}"]
        for name, pick in (("lost", max), ("elsewhere", max), ("covered", min)):
            values = [100 * getattr(one, name) for one in self.found]
            cells += [f"{statistics.fmean(values):.2f}", f"{pick(values):.2f}"] if values else [
                "-", "-"]
        means = [one.mean_mm for one in self.found]
        cells.append(f"{statistics.fmean(means):.2f}" if means else "-")
        return "| " + " | ".join(cells) + " |"


def _on_the_face(box: Box, shot: Simulated) -> bool:
    """Say whether the middle of the true face lies in the detector's box."""
    calibration = shot.frame.calibration
    seen = calibration.color.project(calibration.depth_to_color.apply(shot.truth.face_points()))
    u, v = seen.mean(axis=0)
    x, y, width, height = box
    return bool(x < u < x + width and y < v < y + height)


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="python -m bench.segmentation", description=__doc__)
    parser.add_argument("--heads", nargs="+", default=list(REPORTING), metavar="HEAD",
                        help="default: those for reporting")
    parser.add_argument("--distances", nargs="+", type=float, default=list(_DISTANCES_MM),
                        metavar="MM")
    parser.add_argument("--cases", nargs="+", default=list(CASES), choices=list(CASES),
                        metavar="CASE")
    args = parser.parse_args()
    heads = tuple(name for name in args.heads if name in head_names()) or ("procedural",)
    print(describe("script/bench segmentation " + " ".join(sys.argv[1:])))
    print(f"\nHeads {', '.join(heads)} at "
          f"{', '.join(f'{mm:.0f}' for mm in args.distances)} mm:\n")
    print("| case | faces found | face lost, % | worst | elsewhere, % | worst "
          "| face within 2 mm, % | worst | mean, mm |")
    print("|" + " --- |" * 9)
    for case in args.cases:
        row = _Row(case)
        for shot in shots(case, heads, tuple(args.distances)):
            row.add(shot)
        print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
