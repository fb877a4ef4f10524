"""The paper's Tables 1 and 2 and its Figure 9, of our faces beside its own."""

import statistics
from collections.abc import Iterator, Mapping, Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from denseface.recon import Preset
from denseface.service.tools.evaluation.paper import (
    ERROR_BINS_MM,
    GROSS_MM,
    PAPER_DENSE,
    PAPER_INITIAL,
    PAPER_MEAN_MM,
    PAPER_SD_MM,
    PAPER_TABLE_2,
    paper_distribution,
)
from tests.simulator.accuracy import Accuracy

__all__ = [
    "PAPER_MEAN_MM",
    "PAPER_SD_MM",
    "Results",
    "Taken",
    "deviation_mm",
    "distribution",
    "distribution_table",
    "error_table",
    "gathered",
    "paper_distribution",
    "points_table",
    "quality_table",
]

Taken: TypeAlias = Mapping[Preset, Sequence[Accuracy]]
"""The same frames with each preset."""
Results: TypeAlias = Mapping[str, Taken]
"""By recording or sensor."""

_BINS_A_ROW = 5
"""The table of the distribution has a row for so many of `ERROR_BINS_MM`."""


def _mean(taken: Sequence[Accuracy], field: str) -> float:
    return statistics.fmean(getattr(one, field) for one in taken)


def gathered(results: Results) -> Taken:
    """Put the frames of all recordings or sensors together."""
    first = next(iter(results.values()))
    return {preset: [one for taken in results.values() for one in taken[preset]]
            for preset in first}


def deviation_mm(taken: Sequence[Accuracy]) -> float:
    """Standard deviation of the errors of all frames together, each frame weighing the same, mm."""
    square = statistics.fmean(one.mean_mm ** 2 + one.sd_mm ** 2 for one in taken)
    return float(np.sqrt(max(square - _mean(taken, "mean_mm") ** 2, 0.0)))


def distribution(taken: Sequence[Accuracy]) -> NDArray[np.float64]:
    """Share of points per mm of error, each frame weighing the same: (55,), `ERROR_BINS_MM`."""
    return np.mean([one.per_mm for one in taken], axis=0)


def _headings(*names: str) -> Iterator[str]:
    yield f"| {' | '.join(names)} |"
    yield "|" + " --- |" * len(names)


def points_table(results: Results) -> Iterator[str]:
    """Give the lines of Table 1: initial and dense points and their ratio."""
    presets = list(next(iter(results.values())))
    yield from _headings("recording or sensor", "initial points",
                         *(f"dense, `{preset.value}` (ratio)" for preset in presets))
    for name, taken in results.items():
        dense = " | ".join(f"{_mean(taken[preset], 'dense_points'):,.0f} "
                           f"({_mean(taken[preset], 'ratio'):.1f})" for preset in presets)
        yield f"| {name} | {_mean(taken[presets[0]], 'initial_points'):,.0f} | {dense} |"
    yield (f"| *the paper's Table 1: other faces, another sensor* | *{PAPER_INITIAL}* "
           f"| *{PAPER_DENSE}* |" + " |" * (len(presets) - 1))


def error_table(results: Results) -> Iterator[str]:
    """Give the lines of Table 2: mean and SD of the error."""
    presets = list(next(iter(results.values())))
    yield from _headings("of what", "initial cloud, mm",
                         *(f"`{preset.value}`, mm" for preset in presets), "printed, mm")
    for name, taken in results.items():
        ours = " | ".join(f"{_mean(taken[preset], 'mean_mm'):.2f} ± "
                          f"{deviation_mm(taken[preset]):.2f}" for preset in presets)
        yield f"| {name} | {_mean(taken[presets[0]], 'raw_mean_mm'):.2f} | {ours} | |"
    for name, mean, sd in PAPER_TABLE_2:
        yield (f"| *{name}, in the paper's Table 2: other faces, sensors and references* |"
               + " |" * (len(presets) + 1) + f" *{mean:.2f} ± {sd:.2f}* |")


def distribution_table(shown: Mapping[str, NDArray[np.float64]]) -> Iterator[str]:
    """Give the lines of Figure 9: the share of points per mm of error; `shown` by heading."""
    yield from _headings("error, mm", *(f"{name}, % per mm" for name in shown))
    for at in range(0, len(ERROR_BINS_MM) - 1, _BINS_A_ROW):
        part = slice(at, at + _BINS_A_ROW)
        yield (f"| {ERROR_BINS_MM[at]:.1f}-{ERROR_BINS_MM[at + _BINS_A_ROW]:.1f} | "
               + " | ".join(f"{100 * shares[part].mean():.2f}" for shares in shown.values())
               + " |")
    beyond = (100 * (1 - float(shares @ np.diff(ERROR_BINS_MM))) for shares in shown.values())
    yield (f"| > {GROSS_MM}, % of all | "
           + " | ".join(f"{max(one, 0.0):.2f}" for one in beyond) + " |")


def quality_table(results: Results, preset: Preset) -> Iterator[str]:
    """Give the lines that say more than the paper does."""
    yield from _headings("recording", "raw, mm", "mean, mm", "SD, mm", "> 5.5 mm, %",
                         "face within 2 mm, %", "face lost, %", "elsewhere, %")
    for name, by_preset in results.items():
        taken = by_preset[preset]
        yield (f"| {name} | {_mean(taken, 'raw_mean_mm'):.2f} | {_mean(taken, 'mean_mm'):.2f} "
               f"| {deviation_mm(taken):.2f} | {100 * _mean(taken, 'gross'):.2f} "
               f"| {100 * _mean(taken, 'covered'):.1f} | {100 * _mean(taken, 'lost'):.2f} "
               f"| {100 * _mean(taken, 'elsewhere'):.2f} |")
