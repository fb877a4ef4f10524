"""Errors of one method over many frames, and the row of the table that they make."""

import statistics
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from denseface.service.tools.evaluation.paper import ERROR_BINS_MM, GROSS_MM

__all__ = ["HEADINGS", "ErrorSummary"]

HEADINGS = ("method", "mean over the face, mm", "ours at the same places, mm",
            "inside holes, mm", "holes filled, %", "> 5.5 mm, %", "places covered, %", "ms")
_MIN_FILLED = 0.5
"""With a smaller part of its points filled, a hole's error says nothing."""


@dataclass
class ErrorSummary:
    """Sums over frames; a frame counts once in the mean, a point once inside holes."""

    name: str
    means: list[float] = field(default_factory=list)
    ours: list[float] = field(default_factory=list)
    milliseconds: list[float] = field(default_factory=list)
    counts: NDArray[np.int64] = field(
        default_factory=lambda: np.zeros(len(ERROR_BINS_MM) - 1, np.int64))
    points: int = 0
    places: int = 0
    gross: int = 0
    hole_sum: float = 0.0
    hole_points: int = 0
    hole_places: int = 0

    def add(self, errors: NDArray[np.float64], hole: NDArray[np.bool_],
            ours: NDArray[np.float64] | None, took_ms: float) -> None:
        """Count one frame.

        Parameters
        ----------
        errors : (m,) float64, mm, NaN where the method gives no point
        hole : (m,) bool, which of those places are inside holes
        ours : (m,) float64, mm, our own errors at the same places; None where they differ
        took_ms : time of the method, ms
        """
        known = np.isfinite(errors)
        self.means.append(float(errors[known].mean()))
        if ours is not None:
            self.ours.append(float(ours[known].mean()))
        self.milliseconds.append(took_ms)
        self.counts += np.histogram(errors[known], ERROR_BINS_MM)[0]
        self.points += int(known.sum())
        self.places += len(errors)
        self.gross += int((errors[known] > GROSS_MM).sum())
        self.hole_sum += float(errors[known & hole].sum())
        self.hole_points += int((known & hole).sum())
        self.hole_places += int(hole.sum())

    @property
    def mean_mm(self) -> float:
        """Mean error, averaged over frames, mm."""
        return statistics.fmean(self.means)

    @property
    def hole_mm(self) -> float | None:
        """Mean error inside holes over all points there, mm; None where half are not filled."""
        if self.hole_points <= _MIN_FILLED * self.hole_places:
            return None
        return self.hole_sum / self.hole_points

    @property
    def median_ms(self) -> float:
        """Median time of a frame, ms."""
        return statistics.median(self.milliseconds)

    def row(self) -> str:
        """Give the table's row, `HEADINGS`."""
        hole = "-" if self.hole_mm is None else f"{self.hole_mm:.2f}"
        filled = f"{100 * self.hole_points / self.hole_places:.0f}" if self.hole_places else "-"
        ours = f"{statistics.fmean(self.ours):.2f}" if self.ours else "-"
        took = f"{self.median_ms:,.1f}" if self.milliseconds[0] > 0 else "-"
        return (f"| {self.name} | {self.mean_mm:.2f} | {ours} | {hole} | {filled} "
                f"| {100 * self.gross / self.points:.2f} "
                f"| {100 * self.points / self.places:.1f} | {took} |")
