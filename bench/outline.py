"""What a face's outline looks like, heads with hair and beards of their own shape among them."""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from bench.heads import CHOOSING, REPORTING, at_hand
from bench.machine import describe
from denseface.recon import ReconstructionError, reconstruct
from tests.outlines import OutlineFaults, outline_faults
from tests.simulator import (
    KINECT_CALIBRATED,
    Accuracy,
    Person,
    Scene,
    Simulated,
    measure,
    simulate,
)

__all__ = ["shots"]

_KINDS = ("bald", "hair, every other with a beard")
_DISTANCES_MM = (600.0, 1050.0)
_YAW, _PITCH = 20.0, 8.0
"""Largest turn each way, degrees."""
_HOLES = (0.25, 1.0)
"""`Scene.holes`, by turns."""


def shots(kind: str, heads: list[str], count: int) -> Iterator[Simulated]:
    """Give frames of heads by turns, somewhere before the sensor."""
    for index in range(count):
        rng = np.random.default_rng([31, index, len(heads)])
        person = Person(heads[index % len(heads)], rng.uniform(*_DISTANCES_MM),
                        yaw=rng.uniform(-_YAW, _YAW), pitch=rng.uniform(-_PITCH, _PITCH))
        if kind != _KINDS[0]:
            person = replace(person, hair=True, beard=index % 2 == 1)
        scene = Scene((person,), holes=_HOLES[index % 2], decor=index)
        yield from simulate(scene, KINECT_CALIBRATED, seed=900 + index)


def _row(kind: str, found: list[tuple[Accuracy, OutlineFaults]]) -> str:
    faults = np.array([one for _, one in found])
    covered, lost, gross, mean = np.array(
        [(100 * one.covered, 100 * one.lost, 100 * one.gross, one.mean_mm) for one, _ in found]).T
    return (f"| {kind} | {len(found)} | "
            + " | ".join(f"{value:.1f}" for value in faults.mean(axis=0))
            + f" | {covered.mean():.1f} | {covered.min():.1f} | {lost.mean():.2f} "
            f"| {lost.max():.2f} | {gross.mean():.2f} | {mean.mean():.3f} |")


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench outline", description=__doc__)
    parser.add_argument("--frames", type=int, default=12, metavar="N", help="of each kind (12)")
    parser.add_argument("--on", choices=("reporting", "choosing"), default="reporting",
                        help="heads of the table, or those to choose settings on (reporting)")
    args = parser.parse_args()
    heads = at_hand(CHOOSING if args.on == "choosing" else REPORTING)
    print(describe("script/bench outline " + " ".join(sys.argv[1:])))
    print("\n| head | faces | tongues | mm² | islands | bays | mm² | pin-holes | mm² "
          "| face within 2 mm, % | worst | face lost, % | worst | > 5.5 mm, % | mean, mm |")
    print("|" + " --- |" * 15)
    for kind in _KINDS:
        found = []
        for shot in shots(kind, heads, args.frames):
            try:
                face = reconstruct(shot.frame)
            except ReconstructionError as error:
                print(f"{kind}: {error}", file=sys.stderr)
                continue
            found.append((measure(face, shot.truth, shot.frame), outline_faults(face.dense)))
        print(_row(kind, found), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
