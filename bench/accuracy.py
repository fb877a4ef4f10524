"""The paper's Tables 1 and 2 and its Figure 9, of every preset, recording and kind of sensor.

Errors are distances of all dense points from the true surface. Recordings are those of
`fixtures/recorded_oni`, sensors those of `tests.simulator.sensors` on heads that no setting was
chosen on.
"""

import argparse
import sys
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path

from bench.accuracy_tables import (
    Results,
    Taken,
    distribution,
    distribution_table,
    error_table,
    gathered,
    paper_distribution,
    points_table,
    quality_table,
)
from bench.heads import REPORTING, at_hand
from bench.machine import describe
from bench.sensor_scenes import left_out, scenes
from denseface.capture import RgbdFrame, open_source
from denseface.recon import Preset, ReconstructionError, Settings, reconstruct
from tests.simulator import Accuracy, Truth, measure, simulate
from tests.simulator.sensors import SENSORS

__all__ = ["RECORDINGS"]

RECORDINGS = Path(__file__).resolve().parents[1] / "fixtures" / "recorded_oni"
_DISTANCES_MM = (650.0, 1000.0)
"""The nearest and the farthest of `bench.sensor_scenes`."""


def _frames(name: str) -> Iterator[RgbdFrame]:
    with open_source(str(RECORDINGS / f"{name}.oni")) as source:
        yield from source


def _each_preset(
    frame: RgbdFrame, truth: Truth, presets: list[Preset]
) -> dict[Preset, Accuracy]:
    return {preset: measure(reconstruct(frame, Settings(preset=preset)), truth, frame)
            for preset in presets}


def _by_preset(taken: list[dict[Preset, Accuracy]], presets: list[Preset]) -> Taken:
    return {preset: [one[preset] for one in taken] for preset in presets}


def _recorded(presets: list[Preset]) -> Results:
    """Reconstruct every frame of every recording whose truth is known."""
    names = sorted(path.name.removesuffix(".truth.npz") for path in RECORDINGS.glob("*.truth.npz"))
    found = {}
    for name in names:
        truth = Truth.load(RECORDINGS / f"{name}.truth.npz")
        found[name] = _by_preset([_each_preset(frame, truth, presets) for frame in _frames(name)],
                                 presets)
    return found


def _sensed(sensors: list[str], presets: list[Preset]) -> Results:
    """Let every sensor look at every scene; scene by scene, so that each is built once."""
    found: dict[str, list[dict[Preset, Accuracy]]] = {name: [] for name in sensors}
    for scene, seed in scenes(REPORTING, _DISTANCES_MM):
        for name, taken in found.items():
            shot, = simulate(scene, SENSORS[name], seed=seed)
            try:
                taken.append(_each_preset(shot.frame, shot.truth, presets))
            except ReconstructionError as error:
                print(left_out(scene, name, error), file=sys.stderr)
    return {name: _by_preset(taken, presets) for name, taken in found.items() if taken}


def main() -> int:
    """Print the tables, draw the picture."""
    parser = argparse.ArgumentParser(prog="script/bench accuracy", description=__doc__)
    parser.add_argument("--preset", nargs="+", type=Preset, default=list(Preset)[::-1],
                        choices=list(Preset), help="default: all")
    parser.add_argument("--sensor", action="append", choices=list(SENSORS), metavar="NAME",
                        help=f"only this one; may be repeated: {', '.join(SENSORS)}")
    parser.add_argument("--pictures", type=Path, metavar="FOLDER", help="draw into this folder")
    args = parser.parse_args()
    if args.pictures and find_spec("matplotlib") is None:
        parser.error("--pictures needs matplotlib, which is not installed")
    print(describe(" ".join(["script/bench accuracy", *sys.argv[1:]])))
    recorded = _recorded(args.preset)
    sensed = _sensed(args.sensor or list(SENSORS), args.preset)
    print(f"\nSensors: heads {', '.join(at_hand(REPORTING))} at "
          f"{' and '.join(f'{distance:.0f}' for distance in _DISTANCES_MM)} mm.")
    print("\nPoints, means over frames (the paper's Table 1):\n")
    print(*points_table({**recorded, **sensed}), sep="\n")
    print("\nError, mean ± SD over the points (the paper's Table 2):\n")
    everything = {"all recordings": gathered(recorded), "all sensors": gathered(sensed)}
    print(*error_table({**everything, **recorded, **sensed}), sep="\n")
    shown = {f"`{preset.value}`, {name}": distribution(taken[preset])
             for name, taken in everything.items() for preset in args.preset}
    shown["the paper: gamma distribution of its mean and SD"] = paper_distribution()
    print("\nShare of the points by error (the paper's Figure 9):\n")
    print(*distribution_table(shown), sep="\n")
    for preset in args.preset:
        print(f"\nPreset `{preset.value}`, mean of each recording's frames:\n")
        print(*quality_table(recorded, preset), sep="\n")
    if args.pictures:
        from bench.figures import error_distribution

        error_distribution(shown, args.pictures / "error_distribution.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
