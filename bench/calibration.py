"""How honest `sigma` is: the share of errors within it, against the share that should be.

Frames of the reporting heads at 0.6-1.1 m, few and many holes. `--fit` fits the coefficients of
`recon/propagation/uncertainty.py` anew, on the choosing heads, and prints them.
"""

import argparse
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.calibration_samples import Floats, Samples, frames, sample
from bench.heads import CHOOSING, REPORTING
from bench.machine import describe
from bench.sigma_fit import fitted
from denseface.recon import Preset

__all__: list[str] = []

_FRAMES = 42
_CHOOSING_SEED, _REPORTING_SEED = 11, 13
_BANDS_MM = ((0, 800), (800, 950), (950, 2000))
"""Bands of distance from the camera, mm."""
_PARTS = 10
"""Groups of points by sigma, of the same size."""


def _taken(heads: tuple[str, ...], count: int, seed: int, *, distance: bool) -> dict[
        Preset, Samples]:
    drawn: dict[Preset, list[Samples]] = {preset: [] for preset in Preset}
    for frame, truth in frames(heads, count, seed):
        for preset, parts in drawn.items():
            found = sample(frame, truth, preset, distance=distance and preset is Preset.BEST)
            if found is not None:
                parts.append(found)
    return {preset: Samples.joined(parts) for preset, parts in drawn.items()}


def _groups(of: Samples) -> dict[str, NDArray[np.bool_]]:
    groups = {"everywhere": of.everywhere, "in holes": of.hole,
              "at the rim": of.rim & of.everywhere}
    for low, high in _BANDS_MM:
        groups[f"{max(low, 600) / 1000:g}-{min(high, 1100) / 1000:g} m"] = (
            of.everywhere & (of.z > low) & (of.z <= high))
    edges = np.quantile(of.sigma[of.everywhere], np.linspace(0, 1, _PARTS + 1))
    for part in range(_PARTS):
        groups[f"sigma {edges[part]:.2f}-{edges[part + 1]:.2f} mm"] = (
            of.everywhere & (of.sigma >= edges[part]) & (of.sigma <= edges[part + 1]))
    return groups


def _row(name: str, of: Samples, chosen: NDArray[np.bool_]) -> str:
    sigma = of.sigma[chosen]

    def within(errors: Floats) -> str:
        share = np.abs(errors[chosen]) / sigma
        if np.isnan(share).any():
            return "- | -"
        return " | ".join(f"{100 * (share < k).mean():.1f}" for k in (1, 2))

    return (f"| {name} | {int(chosen.sum()):,} | {np.median(sigma):.2f} | {within(of.error)} "
            f"| {within(of.distance)} |")


def main() -> int:
    """Print the table, draw the picture, fit."""
    parser = argparse.ArgumentParser(prog="script/bench calibration", description=__doc__)
    parser.add_argument("--frames", type=int, default=_FRAMES, help="default: %(default)s")
    parser.add_argument("--fit", action="store_true", help="print coefficients fitted anew")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw into this folder")
    args = parser.parse_args()
    if args.pictures and find_spec("matplotlib") is None:
        parser.error("--pictures needs matplotlib, which is not installed")
    print(describe(" ".join(["script/bench calibration", *sys.argv[1:]])))
    if args.fit:
        found = fitted(_taken(CHOOSING, args.frames, _CHOOSING_SEED, distance=False))
        print("\nFor recon/propagation/uncertainty.py: "
              + ", ".join(f"{name} = {[float(f'{one:.3g}') for one in values]}"
                          for name, values in found.items()))
    taken = _taken(REPORTING, args.frames, _REPORTING_SEED, distance=True)
    for preset, of in reversed(taken.items()):
        print(f"\nPreset `{preset.value}`, {args.frames} frames:\n")
        print("| points | number | median sigma, mm | within 1 sigma, % | within 2, % "
              "| of the distance to the surface, 1 sigma, % | 2, % |")
        print("|" + " --- |" * 7)
        for name, chosen in _groups(of).items():
            print(_row(name, of, chosen))
    if args.pictures:
        from bench.figures import sigma_calibration

        best = taken[Preset.BEST]
        sigma_calibration(
            {name: np.abs(best.error[chosen]) / best.sigma[chosen]
             for name, chosen in list(_groups(best).items())[:3]},
            args.pictures / "sigma_calibration.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
