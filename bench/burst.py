"""Bursts: the error of a face whose depth is the mean of several frames, by that of one frame.

The reporting heads at 0.6 to 1.0 m. The simulator keeps 22 % of the noise's variance the same in
each frame of a still scene, as the difference of published totals and of a real recording's
variance over time asks for: that part no mean takes away.
"""

import argparse
import sys

import numpy as np

from bench.heads import REPORTING, at_hand
from bench.machine import describe
from denseface.capture.burst import fuse
from denseface.recon import reconstruct
from tests.simulator import Person, Scene, measure, simulate

__all__: list[str] = []

_COUNTS = (1, 3, 8, 16)
_DISTANCES_MM = (600.0, 1000.0)
_YAW, _PITCH = 12.0, 6.0
"""Largest turns to either side, degrees."""


def _errors(head: str, seed: int) -> list[tuple[float, float]]:
    """Mean errors of the dense and the initial cloud, mm, for each number of frames."""
    rng = np.random.default_rng([31, seed])
    person = Person(head, rng.uniform(*_DISTANCES_MM), yaw=rng.uniform(-_YAW, _YAW),
                    pitch=rng.uniform(-_PITCH, _PITCH))
    shots = simulate(Scene((person,), decor=seed), seed=500 + seed, frames=_COUNTS[-1])
    found = []
    for count in _COUNTS:
        fused = fuse([shot.frame for shot in shots[:count]])
        accuracy = measure(reconstruct(fused), shots[0].truth, fused)
        found.append((accuracy.mean_mm, accuracy.raw_mean_mm))
    return found


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench burst", description=__doc__)
    parser.add_argument("--scenes", type=int, default=12, help="(%(default)s)")
    args = parser.parse_args()
    heads = at_hand(REPORTING)
    print(describe(" ".join(["script/bench burst", *sys.argv[1:]])))
    print(f"\nHeads {', '.join(heads)}, {args.scenes} scenes:\n")
    errors = np.array([_errors(heads[scene % len(heads)], scene) for scene in range(args.scenes)])
    print("| frames | error, mm | by that of one frame: mean | best | worst | initial cloud, mm |")
    print("|" + " --- |" * 6)
    for index, count in enumerate(_COUNTS):
        dense, initial = errors[:, index].T
        ratio = dense / errors[:, 0, 0]
        print(f"| {count} | {dense.mean():.3f} | {ratio.mean():.3f} | {ratio.min():.3f} | "
              f"{ratio.max():.3f} | {initial.mean():.3f} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
