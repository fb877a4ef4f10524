"""What is said of faces against a truth: the paper's tables, a page, pictures, figures in files."""

import csv
import json
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.metadata import version
from io import StringIO

import numpy as np
from numpy.typing import NDArray

from denseface.service.tools.evaluation.evaluating import Evaluated
from denseface.service.tools.evaluation.paper import (
    ERROR_BINS_MM,
    GROSS_MM,
    PAPER_DENSE,
    PAPER_INITIAL,
    PAPER_TABLE_2,
    Errors,
    paper_distribution,
)
from denseface.service.tools.evaluation.truth import Truth
from denseface.service.tools.picturing import views
from denseface.service.tools.picturing.page import Curve, histogram, page, picture, table

__all__ = ["Row", "Told"]

_VIEW = (360, 440)
_TURNS_DEG = (0.0, 40.0)
_LIMIT_MM = 3.0
"""The colours of an error map end here: three times what is usual."""
_MOST_PICTURES = 12
"""Of a page: its size stays below some megabytes."""
_BAR, _PAPER = "#4c78a8", "#c44e18"
_NAME_LETTERS = 28


@dataclass
class Row:
    """Figures of one face; its points are not kept."""

    name: str
    preset: str
    initial_points: int
    dense_points: int
    initial: Errors
    dense: Errors
    shares: NDArray[np.float64] = field(repr=False)
    moved: bool
    rms_mm: float

    @classmethod
    def of(cls, one: Evaluated) -> "Row":
        """Take the figures of a face."""
        return cls(one.name, one.preset, len(one.face.initial), len(one.face.dense), one.initial,
                   one.dense, one.shares, one.laid.moved, one.laid.rms_mm)


class Told:
    """Gathers faces one by one, and tells of all.

    Parameters
    ----------
    pictured : whether error maps are drawn
    """

    def __init__(self, truth: Truth, *, pictured: bool) -> None:
        self.rows: list[Row] = []
        self.pictures: dict[str, bytes] = {}
        self.truth, self._pictured = truth, pictured

    def add(self, one: Evaluated) -> Row:
        """Take a face."""
        row = Row.of(one)
        self.rows.append(row)
        if self._pictured:
            stem = re.sub(r"[^A-Za-z0-9._-]+", "_", f"error_{one.name}_{one.preset}")[-120:]
            name, number = stem, 2
            while f"{name}.png" in self.pictures:
                name, number = f"{stem}-{number}", number + 1
            self.pictures[f"{name}.png"] = error_map(one)
        return row

    @staticmethod
    def head() -> str:
        """Give the first line of the table on the terminal."""
        return (f"{'face':{_NAME_LETTERS}} {'preset':9}{'initial':>9}{'dense':>10}{'ratio':>7}"
                f"{'initial, mm':>15}{'dense, mm':>15}{'> 5.5 mm':>10}")

    @staticmethod
    def line(row: Row) -> str:
        """Give a face's line: points, their ratio, and mean and SD of the error."""
        name = row.name if len(row.name) <= _NAME_LETTERS else f"...{row.name[3 - _NAME_LETTERS:]}"
        return (f"{name:{_NAME_LETTERS}} {row.preset:9}{row.initial_points:>9,}"
                f"{row.dense_points:>10,}{row.dense_points / row.initial_points:>7.1f}"
                f"{_error(row.initial):>15}{_error(row.dense):>15}{row.dense.gross:>10.2%}")

    def closing(self) -> list[str]:
        """Give what is said below the table."""
        lines = []
        for preset in self._presets():
            rows = [row for row in self.rows if row.preset == preset]
            if len(rows) > 1:
                lines.append(f"all {len(rows)} with {preset}: {_error(_pooled(rows))} mm")
        lines.append("the paper's Table 2: " + ", ".join(
            f"{name} {mean:.2f} ± {sd:.2f}" for name, mean, sd in PAPER_TABLE_2)
            + " mm (other faces, sensors and references)")
        moved = [row for row in self.rows if row.moved]
        if moved:
            on = "the face" if len(self.rows) == 1 else f"{len(moved)} of {len(self.rows)} faces"
            lines.append(
                f"truth in {self.truth.unit}, laid on {on} within "
                f"{max(row.rms_mm for row in moved):.2f} mm (RMS): an error of the sensor that "
                "shifts or turns the whole face is not in the figures")
        else:
            lines.append(f"truth in {self.truth.unit}, taken where it stands")
        return lines

    def csv(self) -> bytes:
        """Give the figures as comma-separated text, UTF-8, the names of the columns first."""
        text = StringIO()
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(("name", "preset", "initial_points", "dense_points", "ratio",
                         "initial_mean_mm", "initial_sd_mm", "mean_mm", "sd_mm", "median_mm",
                         "within_95_mm", "gross", "aligned", "alignment_rms_mm"))
        for row in self.rows:
            writer.writerow((
                row.name, row.preset, row.initial_points, row.dense_points,
                f"{row.dense_points / row.initial_points:.3f}", f"{row.initial.mean_mm:.4f}",
                f"{row.initial.sd_mm:.4f}", f"{row.dense.mean_mm:.4f}", f"{row.dense.sd_mm:.4f}",
                f"{row.dense.median_mm:.4f}", f"{row.dense.within_95_mm:.4f}",
                f"{row.dense.gross:.6f}", "yes" if row.moved else "no", f"{row.rms_mm:.4f}"))
        return text.getvalue().encode("utf-8", "backslashreplace")

    def json(self) -> bytes:
        """Give the figures and the distributions."""
        told = {
            "generator": f"denseface {version('denseface')}", "truth": self.truth.name,
            "unit": self.truth.unit, "error_bins_mm": ERROR_BINS_MM.round(3).tolist(),
            "faces": [{
                "name": row.name, "preset": row.preset, "initial_points": row.initial_points,
                "dense_points": row.dense_points, "aligned": row.moved,
                "alignment_rms_mm": row.rms_mm, "initial": row.initial._asdict(),
                "dense": row.dense._asdict(), "share_per_mm": row.shares.round(6).tolist(),
            } for row in self.rows],
            "paper": {"table_2": [{"name": name, "mean_mm": mean, "sd_mm": sd}
                                  for name, mean, sd in PAPER_TABLE_2],
                      "initial_points": PAPER_INITIAL, "dense_points": PAPER_DENSE}}
        return (json.dumps(told, indent=2, allow_nan=False) + "\n").encode()

    def html(self) -> bytes:
        """Give a page with all tables, the distribution beside the paper's, and error maps."""
        parts = [f"<p>Against {escape(self.truth.name)}. {escape(self.closing()[-1])}.</p>",
                 "<h2>Points before and after (the paper's Table 1)</h2>",
                 table(("face", "preset", "initial", "dense", "ratio"), self._table_1()),
                 "<h2>Error, mean ± SD over the points (the paper's Table 2)</h2>",
                 table(("face", "preset", "initial, mm", "dense, mm", "median, mm",
                        "95 % within, mm", f"> {GROSS_MM} mm"), self._table_2()),
                 "<h2>Distribution of the error (the paper's Figure 9)</h2>"]
        for preset in self._presets():
            rows = [row for row in self.rows if row.preset == preset]
            shares = np.mean([row.shares for row in rows], axis=0)
            parts.append(f"<figure><figcaption>{escape(preset)}, each face weighing the same"
                         "</figcaption>" + histogram(
                             ERROR_BINS_MM, shares, x="error, mm", colors=[_BAR] * len(shares),
                             curves=[Curve("the paper: gamma distribution of its mean and SD",
                                           paper_distribution(), _PAPER)]) + "</figure>")
        for name, png in list(self.pictures.items())[:_MOST_PICTURES]:
            parts.append(picture(png, f"{name.removesuffix('.png')}: distance from the true "
                                      "surface"))
        if len(self.pictures) > _MOST_PICTURES:
            parts.append(f'<p class="note">{len(self.pictures) - _MOST_PICTURES} more error maps '
                         "are beside this page.</p>")
        parts.append('<p class="note">Distances are those of all points from the nearest point of '
                     "the true surface. The paper's figures are of other faces, sensors and "
                     f'references. denseface {escape(version("denseface"))}</p>')
        return page("Faces against the truth", parts)

    def _table_1(self) -> Iterator[Sequence[str]]:
        for row in self.rows:
            yield (row.name, row.preset, f"{row.initial_points:,}", f"{row.dense_points:,}",
                   f"{row.dense_points / row.initial_points:.1f}")
        yield ("the paper", "", PAPER_INITIAL, PAPER_DENSE, "about 10")

    def _table_2(self) -> Iterator[Sequence[str]]:
        for row in self.rows:
            yield (row.name, row.preset, _error(row.initial), _error(row.dense),
                   f"{row.dense.median_mm:.2f}", f"{row.dense.within_95_mm:.2f}",
                   f"{row.dense.gross:.2%}")
        for preset in self._presets():
            rows = [row for row in self.rows if row.preset == preset]
            if len(rows) > 1:
                yield ("all", preset, "", _error(_pooled(rows)), "", "", "")
        for name, mean, sd in PAPER_TABLE_2:
            yield (f"{name}, as the paper prints it", "", "", f"{mean:.2f} ± {sd:.2f}", "", "", "")

    def _presets(self) -> list[str]:
        return list(dict.fromkeys(row.preset for row in self.rows))


def error_map(one: Evaluated) -> bytes:
    """Draw a face in the colours of its errors, from ahead and turned, as a PNG file."""
    dense = one.face.dense
    every = max(1, round(0.8 / dense.grid_step_mm))
    kept = (dense.cells % every == 0).all(axis=1)
    points, normals = (values[kept].astype(np.float64) for values in (dense.points, dense.normals))
    colors = views.sequential(one.distances[kept], _LIMIT_MM)
    row = np.concatenate([views.view(
        points, normals, colors, turn_deg=turn, size=_VIEW,
        step_mm=every * dense.grid_step_mm * (1.0 if turn == 0 else 1.8)) for turn in _TURNS_DEG],
        axis=1)
    words = ("0", f"{_LIMIT_MM / 2:g} mm", f"{_LIMIT_MM:g} mm and more")
    return views.encode_png(np.concatenate(
        [row, views.legend(_LIMIT_MM, row.shape[1], words, both=False)]))


def _error(errors: Errors) -> str:
    return f"{errors.mean_mm:.2f} ± {errors.sd_mm:.2f}"


def _pooled(rows: Sequence[Row]) -> Errors:
    """Put the errors of faces together, each face weighing the same: mean and SD alone."""
    mean = float(np.mean([row.dense.mean_mm for row in rows]))
    square = float(np.mean([row.dense.mean_mm**2 + row.dense.sd_mm**2 for row in rows]))
    return Errors(mean, float(np.sqrt(max(square - mean**2, 0))), np.nan, np.nan,
                  float(np.mean([row.dense.gross for row in rows])))
