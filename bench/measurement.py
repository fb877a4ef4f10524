"""How often a length's 95 % interval holds the true one: heads, distances, turns, noise and holes.

The true lengths are those of the heads' meshes. With `--fit`, the coefficients of
`recon.measurement` from other heads than the table's.
"""

import argparse
import statistics
import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bench.machine import describe
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.measurement import Measurements, Raw, measure, raw_lengths
from tests.simulator import KINECT_CALIBRATED, Person, Scene, head_names, simulate
from tests.simulator.true_lengths import true_lengths

__all__ = ["NAMES", "Sample", "choosing", "reporting", "sampled", "samples"]

NAMES = ("face_width", "face_length", "nose_width", "nose_length")
_SCANS = ("lps", "mh_afr_f", "mh_cauc_m", "mh_asian_f", "ict_id1", "procedural")
"""Whose shape is stretched; `ict_neutral` is a model of identities."""
_IDENTITIES, _STRETCHES, _REPORTING_FROM = 60, 10, 101
"""How many draws of each there are, and the first one of the table."""
_DISTANCES_MM = (550.0, 950.0)
_YAW, _PITCH, _ROLL = 12.0, 8.0, 6.0
"""Largest turns to either side, degrees: the gate lets no more pass."""
_ASIDE_MM = (50.0, 30.0)
_HOLES = (0.25, 0.25, 1.0)
_WITHIN = 0.95
_NORMAL_95 = 1.96


class Sample(NamedTuple):
    """One frame: what was measured and what is true."""

    head: str
    raw: dict[str, Raw]
    measured: Measurements
    true: dict[str, float]


def choosing() -> list[str]:
    """List the heads that coefficients are fitted on."""
    return _heads(0)


def reporting() -> list[str]:
    """List the heads that the table is of: others."""
    return _heads(_REPORTING_FROM)


def _heads(first: int) -> list[str]:
    """The head made by code alone where no scans are at hand; identities and scans in turn."""
    stretched = [f"{name}~{first + k}" for k in range(_STRETCHES)
                 for name in _SCANS if name in head_names()]
    if "ict_neutral" not in head_names():
        return stretched
    identities = [f"ict_neutral~{first + k}" for k in range(_IDENTITIES)]
    return [head for pair in zip(identities, stretched, strict=True) for head in pair]


def samples(heads: list[str], frames: int, seed: int) -> Iterator[Sample]:
    """Take frames of heads in turn, each from somewhere else, and measure them."""
    for index in range(frames):
        taken = sampled(heads[index % len(heads)], index, seed)
        if taken is not None:
            yield taken


def sampled(head: str, index: int, seed: int) -> Sample | None:
    """Take one frame of a head and measure it; None, and a line, where there is no face."""
    rng = np.random.default_rng([61, seed, index])
    x, y = (rng.uniform(-most, most) for most in _ASIDE_MM)
    person = Person(head, rng.uniform(*_DISTANCES_MM), yaw=rng.uniform(-_YAW, _YAW),
                    pitch=rng.uniform(-_PITCH, _PITCH), roll=rng.uniform(-_ROLL, _ROLL),
                    offset_mm=(float(x), float(y)))
    scene = Scene((person,), holes=float(rng.choice(_HOLES)), decor=index)
    shot, = simulate(scene, KINECT_CALIBRATED, seed=1000 * seed + index)
    try:
        face = reconstruct(shot.frame)
    except ReconstructionError as error:
        print(f"{head} is left out: {error}", file=sys.stderr)
        return None
    return Sample(head, raw_lengths(face.dense), measure(face), true_lengths(head))


def _row(name: str, taken: list[Sample]) -> str:
    errors, halves, held = [], [], 0
    for sample in taken:
        length = getattr(sample.measured, name)
        if length is not None:
            errors.append(length.value_mm - sample.true[name])
            halves.append((length.high_mm - length.low_mm) / 2)
            held += length.low_mm <= sample.true[name] <= length.high_mm
    spread = statistics.pstdev(sample.true[name] for sample in taken)
    return (f"| {name.replace('_', ' ')} | {100 * len(errors) / len(taken):.0f} "
            f"| {100 * held / len(errors):.1f} | {statistics.fmean(halves):.1f} "
            f"| {statistics.fmean(errors):+.2f} | {np.median(np.abs(errors)):.2f} "
            f"| {statistics.fmean(sample.true[name] for sample in taken):.0f} ± {spread:.1f} |")


def _fitted(name: str, taken: list[Sample]) -> str:
    """Give offset, place and gain whose intervals are the shortest that hold 95 of 100."""
    known = [sample for sample in taken if name in sample.raw]
    sigma = np.array([sample.raw[name].sigma for sample in known])
    errors = np.array([sample.raw[name].value - sample.true[name] for sample in known])
    offset = float(np.median(errors))
    away: NDArray[np.float64] = np.abs(errors - offset) / _NORMAL_95
    tried = []
    for gain in np.arange(0.25, 4, 0.25):
        rest = np.sqrt(np.maximum(away**2 - (gain * sigma) ** 2, 0))
        place = float(np.quantile(rest, _WITHIN))
        tried.append((float(np.hypot(place, gain * sigma).mean()), place, float(gain)))
    _, place, gain = min(tried)
    return f"| {name} | {offset:.2f} | {place:.2f} | {gain:.2f} |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench measurement", description=__doc__)
    parser.add_argument("--frames", type=int, default=240, help="(%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of poses and noise (%(default)s)")
    parser.add_argument("--fit", action="store_true", help="fit the coefficients")
    args = parser.parse_args()
    print(describe(" ".join(["script/bench measurement", *sys.argv[1:]])))
    taken = list(samples(choosing() if args.fit else reporting(), args.frames, args.seed))
    heads = len({sample.head for sample in taken})
    print(f"\n{len(taken)} frames of {heads} heads:\n")
    if args.fit:
        print("| length | offset, mm | place, mm | gain |\n| --- | --- | --- | --- |")
        for name in NAMES:
            print(_fitted(name, taken))
        return 0
    print("| length | given, % | interval holds the true length, % | half of the interval, mm "
          "| mean error, mm | median of the errors' size, mm | true lengths, mm |")
    print("|" + " --- |" * 7)
    for name in NAMES:
        print(_row(name, taken))
    return 0


if __name__ == "__main__":
    sys.exit(main())
