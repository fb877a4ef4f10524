"""The pictures of docs/benchmarks.md; needs matplotlib, which the dev tools bring along."""

from math import erf
from pathlib import Path

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from bench.cases import Case
from bench.error_summary import ErrorSummary

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

from denseface.service.tools.evaluation.paper import ERROR_BINS_MM, GROSS_MM

__all__ = [
    "error_distribution",
    "error_histogram",
    "error_maps",
    "sigma_calibration",
    "time_against_seeds",
]

_MAP_LARGEST_MM = 3.0
"""Larger errors are red in an error map, mm."""
_COLORS = 128
"""Colours of a picture's palette, which keeps the file small."""


def error_maps(case: Case, errors: dict[str, NDArray[np.float64]], path: Path) -> None:
    """Draw a face coloured by error, once for each method: (m,) mm at the queries each."""
    columns = 4
    rows = -(-len(errors) // columns)
    figure, axes = plt.subplots(rows, columns, figsize=(9, 3 * rows), layout="compressed")
    cells = case.face.dense.cells
    colors = mpl.colormaps["viridis"].with_extremes(bad="white", over="red")
    shown = None
    for axis in axes.flat:
        axis.set_axis_off()
    for axis, (name, values) in zip(axes.flat, errors.items(), strict=False):
        image = np.full(case.face.dense.grid_shape, np.nan)
        image[cells[:, 0], cells[:, 1]] = values
        shown = axis.imshow(image, cmap=colors, vmin=0, vmax=_MAP_LARGEST_MM,
                            interpolation="nearest")
        axis.set_title(f"{_wrapped(name)}\n{np.nanmean(values):.2f} mm", fontsize=7)
    if shown is not None:
        figure.colorbar(shown, ax=axes, label="distance from the true surface, mm",
                        extend="max", shrink=0.6)
    _save(figure, path, 72)


def error_histogram(summaries: list[ErrorSummary], path: Path) -> None:
    """Draw the share of points by error, 0-5.5 mm, the range of the paper's Figure 9."""
    figure, axis = plt.subplots(figsize=(8, 5), layout="constrained")
    width = ERROR_BINS_MM[1] - ERROR_BINS_MM[0]
    for summary in summaries:
        ours = summary.name.startswith("ours")
        axis.stairs(100 * summary.counts / summary.points / width, ERROR_BINS_MM,
                    label=summary.name, linewidth=1.8 if ours else 0.9,
                    linestyle="-" if ours else "--")
    axis.set(xlim=(0, GROSS_MM), yscale="log", ylim=(0.02, 200),
             xlabel="distance from the true surface, mm", ylabel="points, % per mm")
    figure.legend(fontsize=6, loc="outside lower center", ncols=2)
    _save(figure, path, 90)


def error_distribution(shown: dict[str, NDArray[np.float64]], path: Path) -> None:
    """Draw shares of points per mm of error beside the paper's, the last of `shown`.

    shown : (55,) share per mm between `ERROR_BINS_MM`, by name
    """
    figure, axis = plt.subplots(figsize=(8, 5), layout="constrained")
    *ours, paper = shown.items()
    axis.stairs(100 * paper[1], ERROR_BINS_MM, label=paper[0], fill=True, color="lightgray")
    presets = list(dict.fromkeys(name.split(",")[0] for name, _ in ours))
    for name, shares in ours:
        axis.stairs(100 * shares, ERROR_BINS_MM, label=name.replace("`", ""), linewidth=1.3,
                    color=f"C{presets.index(name.split(',')[0])}",
                    linestyle="--" if name.endswith("sensors") else "-")
    axis.set(xlim=(0, GROSS_MM), ylim=(0, None), xlabel="distance from the true surface, mm",
             ylabel="points, % per mm")
    figure.legend(fontsize=7, loc="outside lower center", ncols=2)
    _save(figure, path, 90)


def sigma_calibration(ratios: dict[str, NDArray[np.float64]], path: Path) -> None:
    """Draw the share of errors within k sigma against a normal distribution's: |error| / sigma."""
    figure, axis = plt.subplots(figsize=(5, 5), layout="constrained")
    k = np.linspace(0, 3, 121)
    nominal = 100 * np.array([erf(one / np.sqrt(2)) for one in k])
    axis.plot(nominal, nominal, color="gray", linewidth=0.9, label="nominal")
    for name, values in ratios.items():
        ordered = np.sort(values)
        observed = 100 * np.searchsorted(ordered, k) / len(ordered)
        axis.plot(nominal, observed, linewidth=1.5, label=name)
    for sigmas in (1, 2):
        axis.axvline(100 * erf(sigmas / np.sqrt(2)), color="gray", linewidth=0.6, linestyle=":")
    axis.set(xlim=(0, 100), ylim=(0, 100), aspect="equal",
             xlabel="errors that should be within k sigma, %", ylabel="errors that are, %")
    axis.legend()
    _save(figure, path, 80)


def time_against_seeds(
    times: dict[str, list[tuple[int, float]]], path: Path
) -> None:
    """Draw time against number of seeds, both logarithmic: (seeds, ms) pairs of each method."""
    figure, axis = plt.subplots(figsize=(6, 4.8), layout="constrained")
    for name, pairs in times.items():
        seeds, ms = zip(*pairs, strict=True)
        ours = name.startswith("ours")
        axis.loglog(seeds, ms, "o-" if ours else "s--", label=name, markersize=4,
                    linewidth=1.8 if ours else 0.9)
    axis.set(xlabel="seeds", ylabel="ms")
    axis.grid(which="both", alpha=0.2)
    figure.legend(fontsize=7, loc="outside lower center", ncols=2)
    _save(figure, path, 90)


def _wrapped(name: str) -> str:
    return name.replace(", ", "\n", 1).replace(", our R0", "")


def _save(figure: Figure, path: Path, dpi: int) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=dpi)
    plt.close(figure)
    with Image.open(path) as picture:
        picture.convert("RGB").quantize(_COLORS).save(path, optimize=True)
