"""Faces with one side deformed: what symmetry does to the deformed place, and to its mirror image.

The heads that settings are chosen on; `--reporting` for the others.
"""

import argparse
import sys
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from bench.heads import CHOOSING, REPORTING
from bench.machine import describe
from denseface.recon import Preset, ReconstructionError, Settings, reconstruct
from tests.simulator import (
    KINECT_CALIBRATED,
    Deformed,
    Person,
    Scene,
    head_names,
    load_head,
    patch,
    simulate,
)

__all__: list[str] = []

_DISTANCES_MM = (600.0, 950.0)
_YAW, _PITCH, _ROLL = 20.0, 8.0, 6.0
"""Largest turns to either side, degrees."""
_WAYS = {"without": Settings.of(Preset.BEST, symmetry=False), "with": Settings.of(Preset.BEST)}


def _errors(kind: Deformed, head: str, seed: int) -> Iterator[NDArray[np.float64]]:
    """Mean errors over the face, the deformed place and its mirror image, mm, for each way."""
    rng = np.random.default_rng([23, seed])
    person = Person(f"{head}+{kind}", rng.uniform(*_DISTANCES_MM), yaw=rng.uniform(-_YAW, _YAW),
                    pitch=rng.uniform(-_PITCH, _PITCH), roll=rng.uniform(-_ROLL, _ROLL))
    shot, = simulate(Scene((person,), decor=seed), KINECT_CALIBRATED, seed=seed)
    place = patch(kind, load_head(head).landmarks)
    for settings in _WAYS.values():
        points = reconstruct(shot.frame, settings).dense.points
        error = shot.truth.surface_distance(points)
        x, y, _ = ((points - person.shift) @ person.rotation).T
        yield np.array([error.mean()] + [
            error[np.hypot(x - side * place.x, y - place.y) < place.radius].mean()
            for side in (1, -1)])


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench asymmetry", description=__doc__)
    parser.add_argument("--frames", type=int, default=9, help="of each kind (%(default)s)")
    parser.add_argument("--reporting", action="store_true", help="on the reporting heads")
    args = parser.parse_args()
    wanted = REPORTING if args.reporting else CHOOSING
    heads = [name for name in wanted if name in head_names()] or ["procedural"]
    print(describe(" ".join(["script/bench asymmetry", *sys.argv[1:]])))
    print(f"\nHeads {', '.join(heads)}, {args.frames} frames of each:\n")
    print("| deformed | whole face, mm | with symmetry | there, mm | with symmetry "
          "| mirror image of it, mm | with symmetry |")
    print("|" + " --- |" * 7)
    for index, kind in enumerate(Deformed):
        found = []
        for frame in range(args.frames):
            try:
                found.append(list(_errors(kind, heads[frame % len(heads)],
                                          100 * (index + 1) + frame)))
            except ReconstructionError as error:
                print(f"{kind} {frame} is left out: {error}", file=sys.stderr)
        without, with_it = np.nanmean(found, axis=0)
        print(f"| {kind} | " + " | ".join(
            f"{one:.3f} | {other:.3f} ({100 * (other / one - 1):+.1f} %)"
            for one, other in zip(without, with_it, strict=True)) + " |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
