"""What settings that trade points for speed cost and gain, on the recordings whose truth is known.

    script/bench low_end [--runs N]

Times are the processor's, each frame by all settings in turn, the least of the runs over the least
of `best`; so what else the machine does hardly counts. Errors are distances of all dense points
from the true surface.
"""

import argparse
import sys
import time
from dataclasses import dataclass
from types import SimpleNamespace
from unittest.mock import patch

import cv2
import numpy as np

from bench.accuracy import RECORDINGS
from bench.machine import describe
from denseface.capture import RgbdFrame, open_source
from denseface.recon import Settings, pipeline, reconstruct, warm
from denseface.service.export.face_grid import encode_face_grid
from denseface.service.export.mesh import triangulate
from tests.simulator import Accuracy, Truth, measure

__all__: list[str] = []

_VARIANTS = {
    "`best`": Settings(),
    "`best`, `ratio=5`": Settings(ratio=5),
    "`best`, `ratio=2.5`": Settings(ratio=2.5),
    "`best`, `ratio=1`": Settings(ratio=1),
    "`best`, `prior=false`": Settings(prior=False),
    "`best`, `shading=false`": Settings(shading=False),
    "`best`, `symmetry=false`": Settings(symmetry=False),
    "`best`, `detail_factor=none`": Settings(detail_factor=None),
    "`best`, `pixel_mm=3`": Settings(pixel_mm=3),
    "`light`": Settings.of("light"),
    "`light`, `pixel_mm=4`": Settings.of("light", pixel_mm=4),
    "`light`, `shading=false`": Settings.of("light", shading=False),
    "`light`, `ratio=4`": Settings.of("light", ratio=4),
    "`faithful`, `neighbors=lattice`": Settings.of("faithful", neighbors="lattice"),
    "`faithful`": Settings.of("faithful"),
}
# In place of the stages' own clock: what else runs on the machine does not count.
_PROCESSOR = SimpleNamespace(perf_counter=time.process_time)


@dataclass(frozen=True)
class _Taken:
    """Of one frame by one variant."""

    ms: dict[str, float]
    """Least time of each stage."""
    accuracy: Accuracy
    triangles: int
    sent_kb: float
    """What a browser is sent of the face, before compression on its way."""


def _take(frame: RgbdFrame, truth: Truth, runs: int) -> dict[str, _Taken]:
    times: dict[str, list[dict[str, float]]] = {name: [] for name in _VARIANTS}
    for _ in range(runs):
        for name, settings in _VARIANTS.items():
            with patch.object(pipeline, "time", _PROCESSOR):
                times[name].append(reconstruct(frame, settings).report.timings_ms)
    found = {}
    for name, settings in _VARIANTS.items():
        face = reconstruct(frame, settings)
        found[name] = _Taken(
            {stage: min(one[stage] for one in times[name]) for stage in times[name][0]},
            measure(face, truth, frame), len(triangulate(face.dense)),
            len(encode_face_grid(face)) / 1000)
    return found


def _row(name: str, taken: list[_Taken], best: list[_Taken]) -> str:
    ratios = [one.ms["total"] / other.ms["total"] for one, other in zip(taken, best, strict=True)]
    figures = [(one.accuracy.initial_points, one.accuracy.dense_points, one.accuracy.mean_mm,
                one.accuracy.gross, one.accuracy.covered, one.triangles, one.sent_kb)
               for one in taken]
    initial, dense, error, gross, covered, triangles, sent = np.mean(figures, axis=0)
    return (f"| {name} | {np.mean(ratios):.2f} | {min(ratios):.2f}-{max(ratios):.2f} "
            f"| {initial:,.0f} | {dense:,.0f} | {error:.3f} | {100 * gross:.2f} | "
            f"{100 * covered:.1f} | {triangles:,.0f} | {sent:,.0f} |")


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="script/bench low_end", description=__doc__)
    parser.add_argument("--runs", type=int, default=9, help="of all, by turns (default: 9)")
    runs = parser.parse_args().runs
    cv2.setNumThreads(1)
    print(describe(" ".join(["script/bench low_end", *sys.argv[1:]])))
    warm()
    taken: dict[str, list[_Taken]] = {name: [] for name in _VARIANTS}
    names = sorted(path.name.removesuffix(".truth.npz") for path in RECORDINGS.glob("*.truth.npz"))
    for name in names:
        with open_source(str(RECORDINGS / f"{name}.oni")) as source:
            frame = next(iter(source))
        truth = Truth.load(RECORDINGS / f"{name}.truth.npz")
        for variant, one in _take(frame, truth, runs).items():
            taken[variant].append(one)
    best = taken["`best`"]
    print(f"\nMeans over the first frames of {len(names)} recordings, {runs} runs by turns:\n")
    print("| settings | time, of `best` | least and most | measured points | dense points | mean "
          "error, mm | above 5.5 mm, % | of the face within 2 mm, % | triangles | sent, kB |")
    print("|" + " --- |" * 10)
    for variant, found in taken.items():
        print(_row(variant, found, best))
    print("\nWhere the time goes, ms of this machine, mean of the least:\n")
    shown = ("`best`", "`light`")
    print("| stage | " + " | ".join(shown) + " |\n|" + " --- |" * (1 + len(shown)))
    for stage in best[0].ms:
        means = [np.mean([one.ms[stage] for one in taken[variant]]) for variant in shown]
        print(f"| {stage} | " + " | ".join(f"{ms:.1f}" for ms in means) + " |")
    print("\nBy recording, `light`:\n\n| recording | time, of `best` | mean error, mm, `best` "
          "| `light` |\n| --- | --- | --- | --- |")
    for name, one, other in zip(names, taken["`light`"], best, strict=True):
        print(f"| {name} | {one.ms['total'] / other.ms['total']:.2f} "
              f"| {other.accuracy.mean_mm:.3f} | {one.accuracy.mean_mm:.3f} |")
    return 0


if __name__ == "__main__":
    sys.exit(main())
