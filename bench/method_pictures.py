"""The pictures of docs/method.md."""

import argparse
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("Agg")
from matplotlib import pyplot as plt

from bench.adaptation import CUTOFFS, Prepared, prepared, with_cutoff
from bench.heads import REPORTING
from denseface.recon import Settings
from denseface.recon.fitting import plan_fit
from denseface.recon.noise import SHARPNESS
from denseface.recon.noise import _kernels as kernels
from denseface.recon.noise._measure import gentle_places

__all__: list[str] = []

_SHOWN = ("kinect v1", "structured light, alike over 1 px", "time of flight", "active stereo")
_SHARPNESS, *_ = SHARPNESS
"""Of the fits that are drawn."""
_DPI = 90
_HEAD = 1
"""Which of the reporting heads' frames: at 800 mm."""


def _variogram(frames: dict[str, Prepared], path: Path) -> None:
    """Mean squares of third differences over the lag, and what they are explained by."""
    figure, axes = plt.subplots(1, len(frames), figsize=(11, 3.2), sharey=True,
                                layout="constrained")
    lags = np.array(kernels.LAGS, float)
    for axis, (name, one) in zip(axes, frames.items(), strict=True):
        heights = kernels.lattice(one.seeds.points, one.seeds.pixels)
        squares = kernels.mean_square_differences(heights, gentle_places(heights, one.spacing), 1)
        noise = one.noise
        alike = [np.exp(-((k * lags / (2 * noise.length_px)) ** 2)) for k in (1, 2, 3)]
        smooth = noise.smooth_mm**2 * (1 - (30 * alike[0] - 12 * alike[1] + 2 * alike[2]) / 20)
        face = kernels.FACE[1, 0] * (lags * one.spacing) ** kernels.FACE[1, 1]
        axis.plot(lags, squares[1], "ko", label="measured")
        axis.plot(lags, np.full(len(lags), noise.white_mm**2), ":", label="white noise")
        axis.plot(lags, smooth, "--", label="smooth noise")
        axis.plot(lags, face, "-.", label="face")
        axis.set(title=f"{name}\n{noise.white_mm:.2f} mm white, {noise.smooth_mm:.2f} mm alike "
                       f"over {noise.length_px:.1f} px", xlabel="lag, pixels", yscale="log",
                 ylim=(0.01, 30))
        axis.title.set_fontsize(8)
    axes[0].set_ylabel("third differences² / 20, mm²")
    axes[0].legend(fontsize=7)
    figure.savefig(path, dpi=_DPI)


def _risk(frames: dict[str, Prepared], path: Path) -> None:
    """Expected and measured error over the cut-off."""
    figure, (expected, measured) = plt.subplots(1, 2, figsize=(9, 3.6), layout="constrained")
    tried = [with_cutoff(cutoff, _SHARPNESS) for cutoff in CUTOFFS]
    for name, one in frames.items():
        plans = [plan_fit(settings, one.noise, one.spacing) for settings in tried]
        line, = expected.plot(CUTOFFS, [plan.error_mm for plan in plans], label=name)
        measured.plot(CUTOFFS, [one.error(one.dense(settings).points) for settings in tried], "o-",
                      color=line.get_color(), markersize=3)
        chosen = plan_fit(Settings(), one.noise, one.spacing)
        for axis in (expected, measured):
            axis.axvline(chosen.r0_factor / _SHARPNESS, color=line.get_color(), linewidth=0.6,
                         linestyle=":")
    expected.set(xlabel="cut-off, spacings", ylabel="expected error, root mean square, mm",
                 yscale="log")
    measured.set(xlabel="cut-off, spacings", ylabel="true mean error, mm", yscale="log")
    expected.legend(fontsize=7)
    figure.savefig(path, dpi=_DPI)


def main() -> int:
    """Draw them."""
    parser = argparse.ArgumentParser(prog="python -m bench.method_pictures", description=__doc__)
    parser.add_argument("folder", type=Path, help="where the pictures go")
    args = parser.parse_args()
    frames = {name: list(prepared(REPORTING[:1], name))[_HEAD] for name in _SHOWN}
    _variogram(frames, args.folder / "variogram.png")
    _risk(frames, args.folder / "risk.png")
    return 0


if __name__ == "__main__":
    sys.exit(main())
