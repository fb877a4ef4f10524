"""The table of many faces: a line for each frame, as it is done; and as a file."""

import csv
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import StringIO
from statistics import median

import numpy as np

from denseface.recon.face import Face

__all__ = ["Row", "Tally", "head", "line", "to_csv"]

_LEAST_NAME, _MOST_NAME = 8, 40
"""Letters of a name that the table has room for."""


@dataclass(frozen=True)
class Row:
    """What became of one frame."""

    name: str
    """Of its files, without their endings."""
    source: str
    """File or folder, as given."""
    frame: int | None
    """Its number, from 0; None where the source could not be opened."""
    why_not: str = ""
    """Why there is no face; empty where there is one."""
    unreadable: bool = False
    """There is no face because there is no frame."""
    measured: int = 0
    dense: int = 0
    sigma_mm: float = 0.0
    """Median standard error of the dense points."""
    ms: float = 0.0
    warnings: tuple[str, ...] = ()

    @classmethod
    def of(cls, name: str, source: str, frame: int | None, face: Face) -> "Row":
        """Give the row of a face."""
        report = face.report
        return cls(name, source, frame, measured=report.initial_points, dense=report.dense_points,
                   sigma_mm=float(np.median(face.dense.sigma)), ms=report.timings_ms["total"],
                   warnings=report.warnings)


def head(width: int) -> str:
    """Give the table's first line, for names of a width."""
    return (f"{'name':{_room(width)}}{'frame':>7}{'measured':>10}{'dense':>10}"
            f"{'sigma mm':>10}{'ms':>7}  remark")


def line(row: Row, width: int) -> str:
    """Give a row's line."""
    name = f"{row.name:{_room(width)}}{'-' if row.frame is None else row.frame:>7}"
    if row.why_not:
        return f"{name}{'-':>10}{'-':>10}{'-':>10}{'-':>7}  {row.why_not}"
    remark = f"  {_count(len(row.warnings), 'warning')}" if row.warnings else ""
    return (f"{name}{row.measured:>10,}{row.dense:>10,}{row.sigma_mm:>10.2f}{row.ms:>7.0f}"
            f"{remark}")


def to_csv(rows: Sequence[Row]) -> bytes:
    """Give the table as a file: comma-separated, UTF-8, the names of the columns first.

    What is not known is empty.
    """
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(("name", "source", "frame", "measured", "dense", "sigma_mm", "ms", "warnings",
                     "why_not"))
    for row in rows:
        figures = (row.measured, row.dense, f"{row.sigma_mm:.3f}", f"{row.ms:.1f}")
        writer.writerow((row.name, row.source, "" if row.frame is None else row.frame,
                         *(("",) * len(figures) if row.why_not else figures),
                         "; ".join(row.warnings), row.why_not))
    return text.getvalue().encode("utf-8", "backslashreplace")


@dataclass
class Tally:
    """What became of all frames together."""

    sigma_mm: list[float] = field(default_factory=list)
    dense: list[int] = field(default_factory=list)
    ms: list[float] = field(default_factory=list)
    without: int = 0
    """Frames without a face."""
    unreadable: int = 0
    """Frames and sources that could not be read."""
    warnings: dict[str, int] = field(default_factory=dict)
    """How many faces had each."""

    def add(self, row: Row) -> None:
        """Count one more."""
        if row.unreadable:
            self.unreadable += 1
        elif row.why_not:
            self.without += 1
        else:
            self.sigma_mm.append(row.sigma_mm)
            self.dense.append(row.dense)
            self.ms.append(row.ms)
        for warning in set(row.warnings):
            self.warnings[warning] = self.warnings.get(warning, 0) + 1

    @property
    def faces(self) -> int:
        """How many there are."""
        return len(self.ms)

    def counts(self) -> str:
        """Say how many faces there are, and what else."""
        parts = [_count(self.faces, "face")]
        if self.without:
            parts.append(f"{_count(self.without, 'frame')} without a face")
        if self.unreadable:
            parts.append(f"{self.unreadable} unreadable")
        return ", ".join(parts)

    @property
    def frames(self) -> int:
        """How many were tried."""
        return self.faces + self.without + self.unreadable

    def medians(self) -> list[str]:
        """Say in a line what the middle face is like; in none where there is none."""
        if not self.faces:
            return []
        return [f"medians: {median(self.dense):,.0f} dense points, sigma "
                f"{median(self.sigma_mm):.2f} mm, {median(self.ms):.0f} ms"]


def _room(width: int) -> int:
    return min(max(width, _LEAST_NAME), _MOST_NAME)


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"
