"""Error of the reconstructed faces against the true surface, for every recording."""

import argparse
import statistics
import sys
from collections.abc import Iterator
from pathlib import Path

from denseface.capture import RgbdFrame, open_source
from denseface.recon import Preset, Settings, reconstruct
from tests.simulator import Accuracy, Truth, measure

__all__ = ["RECORDINGS", "measured"]

RECORDINGS = Path(__file__).resolve().parents[1] / "fixtures" / "recorded_oni"


def measured(name: str, settings: Settings) -> list[Accuracy]:
    """Reconstruct each frame of a recording and compare it with its truth."""
    truth = Truth.load(RECORDINGS / f"{name}.truth.npz")
    return [measure(reconstruct(frame, settings), truth, frame) for frame in _frames(name)]


def _frames(name: str) -> Iterator[RgbdFrame]:
    with open_source(str(RECORDINGS / f"{name}.oni")) as source:
        yield from source


def _row(name: str, taken: list[Accuracy]) -> str:
    def mean(field: str) -> float:
        return statistics.fmean(getattr(one, field) for one in taken)

    return (f"| {name} | {mean('initial_points'):,.0f} | {mean('dense_points'):,.0f} "
            f"| {mean('ratio'):.1f} | {mean('raw_mean_mm'):.2f} | {mean('mean_mm'):.2f} "
            f"| {mean('sd_mm'):.2f} | {100 * mean('gross'):.2f} | {100 * mean('covered'):.1f} "
            f"| {100 * mean('lost'):.2f} | {100 * mean('elsewhere'):.2f} |")


def main() -> int:
    """Print one table for each preset."""
    parser = argparse.ArgumentParser(prog="python -m bench.accuracy", description=__doc__)
    parser.add_argument("--preset", nargs="+", type=Preset, default=list(Preset)[::-1],
                        choices=list(Preset), help="default: all")
    names = sorted(path.name.removesuffix(".truth.npz") for path in RECORDINGS.glob("*.truth.npz"))
    for preset in parser.parse_args().preset:
        print(f"\nPreset `{preset.value}`, mean of each recording's frames:\n")
        print("| recording | initial | dense | ratio | raw, mm | mean, mm | SD, mm | > 5.5 mm, % "
              "| face within 2 mm, % | face lost, % | elsewhere, % |")
        print("|" + " --- |" * 11)
        for name in names:
            print(_row(name, measured(name, Settings(preset=preset))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
