"""What the engine finds by itself for a kind of sensor, beside what a search finds.

For each sensor of `tests.simulator.sensors`, on heads that no setting was chosen on: the error with
R0 and lambda from the measured noise, beside the best fixed setting and the best single Gaussian
fit that a search over all frames of that sensor finds, and how often `sigma` holds.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.calibration_samples import near_rim
from bench.cases import HOLE_SPACINGS
from bench.heads import CHOOSING, REPORTING, at_hand
from bench.machine import describe
from bench.sensor_scenes import DISTANCES_MM, left_out, scenes
from denseface.recon import ReconstructionError, Settings
from denseface.recon.face import DenseCloud, Seeds
from denseface.recon.finding import find_face
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.intermediate import ColorSampler
from denseface.recon.noise import SHARPNESS, Noise, fit_of_cutoff, measure_noise
from denseface.recon.propagation import densify
from denseface.recon.registration import register, sample_colors
from denseface.recon.segmentation import box_window, segment_face
from denseface.recon.surface import mean_spacing
from tests.simulator import Label, Truth, simulate
from tests.simulator.sensors import SENSORS

__all__ = ["CUTOFFS", "FIXED", "PLAIN", "Prepared", "Row", "compare", "prepared", "with_cutoff"]

_POINTS = 4000
"""Points drawn from a frame."""
_MOST_MM = 20.0
"""An error counts as no more than this."""

Floats = NDArray[np.float64]


CUTOFFS = (8.0, 9.5, 11.0, 13.0, 15.0, 18.0, 22.0, 26.0, 31.0)
"""Waves longer than this pass a fit, mean spacings."""


def with_cutoff(cutoff: float, sharpness: float, detail_factor: float = 1.0) -> Settings:
    """Give `best` with a fixed fit: parameters are those of `fit_of_cutoff`."""
    r0_factor, smoothing = fit_of_cutoff(cutoff, sharpness)
    return Settings.of("best", r0_factor=r0_factor, smoothing=smoothing,
                       detail_factor=detail_factor)


FIXED = tuple(with_cutoff(cutoff, sharpness, detail)
              for cutoff in CUTOFFS for sharpness in SHARPNESS for detail in (0.8, 1.0, 1.5))
"""What `best` could be set to."""
PLAIN = tuple(Settings.of("faithful", r0_factor=r0, smoothing=smoothing)
              for r0 in (5.0, 6.0, 8.0, 10.0, 12.0, 14.0) for smoothing in (0.1, 0.3, 1.0, 3.0))
"""Single Gaussian fits of the paper's form."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A frame, segmented once: every setting gets the same seeds."""

    seeds: Seeds
    spacing: float
    noise: Noise
    sampler: ColorSampler
    truth: Truth

    def dense(self, settings: Settings) -> DenseCloud:
        """Reconstruct with some settings."""
        plan = plan_fit(settings, self.noise, self.spacing)
        surface = surface_of(self.seeds.points, self.spacing, settings, plan, self.sampler)
        return densify(self.seeds, surface, self.spacing, settings.ratio, plan, self.sampler)

    def error(self, points: NDArray[np.float32]) -> float:
        """Mean distance of points on the face from the true surface, mm."""
        drawn = points[np.random.default_rng(0).permutation(len(points))[:_POINTS]]
        away = self.truth.surface_distance(drawn[self.truth.labels_at(drawn) == Label.FACE])
        return float(np.minimum(away, _MOST_MM).mean())


def prepared(heads: tuple[str, ...], sensor: str) -> Iterator[Prepared]:
    """Give frames of some heads as a sensor sees them."""
    for scene, seed in scenes(heads):
        shot, = simulate(scene, SENSORS[sensor], seed=seed)
        frame = shot.frame
        try:
            found = find_face(frame, lambda _: None)
            tied = register(frame, *box_window(found.overview, found.detection.box))
            seeds = segment_face(tied, found.detection.box, frame.calibration.color.fx)
        except ReconstructionError as error:
            print(left_out(scene, sensor, error), file=sys.stderr)
            continue
        spacing = mean_spacing(seeds.points, seeds.pixels, Settings().neighbors)
        yield Prepared(seeds, spacing, measure_noise(seeds.points, seeds.pixels, spacing),
                       partial(sample_colors, frame, tied), shot.truth)


@dataclass(frozen=True, eq=False)
class Row:
    """What was found for one sensor; errors are means over its frames, mm.

    Attributes
    ----------
    noise : as measured, mean over the frames: total, mm, correlation, pixels, quantum, mm
    raw, ours : errors of the seeds, and of `best`
    fixed, plain : the least error of `FIXED` and of `PLAIN`, with the setting
    within : (3, 2), of all points, in holes, at the rim: shares of errors within one and two sigma
    """

    noise: Floats
    raw: float
    ours: float
    fixed: tuple[float, Settings]
    plain: tuple[float, Settings]
    within: Floats


def compare(frames: list[Prepared]) -> Row:
    """Search the settings on all frames of a sensor, and look at ours beside them."""
    ours, within = [], []
    for one in frames:
        dense = one.dense(Settings())
        ours.append(one.error(dense.points))
        within.append(_errors_in_sigma(one, dense))
    groups = [np.concatenate([errors[k] for errors in within]) for k in range(3)]
    noises = [(one.noise.total_mm, one.noise.correlation_px, one.noise.quantum_mm)
              for one in frames]
    return Row(
        noise=np.mean(noises, axis=0), ours=float(np.mean(ours)),
        raw=float(np.mean([one.error(one.seeds.points) for one in frames])),
        fixed=_best(frames, FIXED), plain=_best(frames, PLAIN),
        within=np.array([[(group < k).mean() for k in (1, 2)] for group in groups]))


def _best(frames: list[Prepared], tried: tuple[Settings, ...]) -> tuple[float, Settings]:
    errors = [float(np.mean([one.error(one.dense(settings).points) for one in frames]))
              for settings in tried]
    at = int(np.argmin(errors))
    return errors[at], tried[at]


def _errors_in_sigma(one: Prepared, dense: DenseCloud) -> tuple[Floats, Floats, Floats]:
    """Errors along the rays over sigma: of all points drawn, those in holes, those at the rim."""
    drawn = np.random.default_rng(1).permutation(len(dense))[:_POINTS]
    points = dense.points[drawn]
    away, _ = cKDTree(one.seeds.points[:, :2]).query(points[:, :2])
    errors = np.abs(one.truth.depth_error(points)) / dense.sigma[drawn]
    known = np.isfinite(errors)
    return (errors[known], errors[known & (away > HOLE_SPACINGS * one.spacing)],
            errors[known & near_rim(dense, one.spacing)[drawn]])


def _of(settings: Settings) -> str:
    text = f"{settings.r0_factor:.3g}, {settings.smoothing:.2g}"
    return text if settings.detail_factor is None else f"{text}, {settings.detail_factor:g}"


def _line(sensor: str, row: Row) -> str:
    (fixed, at), (plain, plain_at) = row.fixed, row.plain
    shares = " | ".join(f"{100 * one:.0f}, {100 * two:.0f}" for one, two in row.within)
    total, correlation, quantum = row.noise
    return (f"| {sensor} | {total:.2f}, {correlation:.1f}, {quantum:.2f} | {row.raw:.2f} "
            f"| **{row.ours:.3f}** | {fixed:.3f} ({_of(at)}) | {100 * (row.ours / fixed - 1):+.1f} "
            f"| {plain:.3f} ({_of(plain_at)}) | {100 * (row.ours / plain - 1):+.1f} | {shares} |")


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench adaptation", description=__doc__)
    parser.add_argument("--choosing", action="store_true", help="on the choosing heads")
    parser.add_argument("--sensor", action="append", choices=list(SENSORS), metavar="NAME",
                        help=f"only this one; may be repeated: {', '.join(SENSORS)}")
    args = parser.parse_args()
    heads = CHOOSING if args.choosing else REPORTING
    print(describe(" ".join(["script/bench adaptation", *sys.argv[1:]])))
    print(f"\nHeads {', '.join(at_hand(heads))} at {', '.join(f'{d:.0f}' for d in DISTANCES_MM)} "
          "mm; errors on the face, mm:\n")
    print("| sensor | noise measured: mm, alike over px, levels, mm | raw | `best` "
          "| best fixed (R0, lambda, detail) | against it, % | best single fit (R0, lambda) "
          "| against it, % | within 1, 2 sigma, % | in holes | at the rim |")
    print("|" + " --- |" * 11)
    for sensor in args.sensor or SENSORS:
        print(_line(sensor, compare(list(prepared(heads, sensor)))), flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
