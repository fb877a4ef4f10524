"""What a page tells of a summary: counts, kinds of errors, distributions, the worst rows.

The file is read twice, a group of rows at a time: what is kept of it does not grow with the rows.
"""

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from denseface.service.tools.batch.row import Row, State
from denseface.service.tools.batch.summary._table import SummaryFile
from denseface.service.tools.batch.summary.schema import rows_of

__all__ = ["QUANTITIES", "Distribution", "Figures", "Kind", "Quantity", "gather"]

_MOST_KINDS, _EXAMPLES, _REASONS = 24, 4, 4
"""Of errors; of each of them."""
_MOST_TEXTS = 2000
"""Different texts that are counted at a time; the rarer half of more is forgotten."""
_WORST, _SPREAD = 24, 48
"""Faces that are shown as the worst, and to show how the others look."""
_BARS = 40
_LEAST, _MOST, _STEPS = 1e-4, 1e9, 4096
"""Of the values of which a quantile is known to 0.4 %; a logarithmic scale of so many steps."""
_NUMBERS = re.compile(r"\d+(\.\d+)?")


class Quantity(NamedTuple):
    """A column of numbers, in words."""

    column: str
    title: str
    unit: str
    digits: int


QUANTITIES = (
    Quantity("sigma_mm", "Standard error of the dense points, median of a face", "mm", 2),
    Quantity("dense", "Dense points", "points", 0),
    Quantity("measured", "Measured points", "points", 0),
    Quantity("noise_mm", "Noise of depth", "mm", 2),
    Quantity("face_score", "How sure it is that this is a face, 0 to 1", "", 3),
    Quantity("seconds", "Time of a frame on its worker, with and without a face", "s", 2),
)
_NUMERIC = tuple(one.column for one in QUANTITIES)


@dataclass
class Distribution:
    """Of the values of a column."""

    count: int = 0
    least: float = np.inf
    most: float = -np.inf
    total: float = 0.0
    _steps: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_STEPS, np.int64))
    edges: NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    """Of the bars."""
    bars: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, np.int64))
    outside: int = 0
    """Values beyond the bars: the last of two hundred at either end."""

    def add(self, values: NDArray[np.float64]) -> None:
        """Count values, none of them NaN."""
        if not len(values):
            return
        self.count += len(values)
        self.total += float(values.sum())
        self.least = min(self.least, float(values.min()))
        self.most = max(self.most, float(values.max()))
        share = np.log(np.clip(values, _LEAST, _MOST) / _LEAST) / np.log(_MOST / _LEAST)
        self._steps += np.bincount(
            np.minimum(share * _STEPS, _STEPS - 1).astype(np.intp), minlength=_STEPS)

    def quantile(self, share: float) -> float:
        """Give the value below which a share of all is, to 0.4 %."""
        step = int(np.searchsorted(np.cumsum(self._steps), share * self.count))
        value = _LEAST * (_MOST / _LEAST) ** ((min(step, _STEPS - 1) + 0.5) / _STEPS)
        return float(np.clip(value, self.least, self.most))

    def draw_bars(self, *, whole: bool) -> None:
        """Choose the bars from the values that were counted; then `add_to_bars` takes them."""
        if not self.count:
            return
        # Wider by as much as a quantile may be wrong, or the ends of few values were outside.
        low = max(self.quantile(0.005) * 0.996, self.least)
        high = min(self.quantile(0.995) * 1.004, self.most)
        if high - low < 1e-9 * max(high, 1.0):
            low, high = low - 0.5, high + 0.5
        bars = min(_BARS, round(high - low) + 1) if whole else _BARS
        self.edges = np.linspace(low, high, bars + 1)
        self.bars = np.zeros(bars, np.int64)

    def add_to_bars(self, values: NDArray[np.float64]) -> None:
        """Count values in bars."""
        if len(self.edges):
            inside = np.histogram(values, self.edges)[0]
            self.bars += inside
            self.outside += len(values) - int(inside.sum())


@dataclass
class Kind:
    """Frames without a face for the same class of error."""

    state: State
    error: str
    count: int = 0
    reasons: Counter[str] = field(default_factory=Counter)
    """How often each was given, numbers and the file's name apart; as it was said first."""
    said: dict[str, str] = field(default_factory=dict)
    """Reasons without numbers and names, and as each was said first."""
    places: list[tuple[int, int]] = field(default_factory=list)
    """Group and row of examples, each for another reason or of another source ..."""
    spare: list[tuple[int, int]] = field(default_factory=list)
    """... and of others, for where there are too few of these."""
    last_source: str = ""
    examples: list[Row] = field(default_factory=list)


@dataclass
class Figures:
    """All that the page tells."""

    rows: int = 0
    sources: int = 0
    seconds: float = 0.0
    """Of all workers together."""
    states: Counter[State] = field(default_factory=Counter)
    warnings: Counter[str] = field(default_factory=Counter)
    retried: int = 0
    """Frames that were tried more than once."""
    kinds: list[Kind] = field(default_factory=list)
    """Errors, the most frequent first."""
    kinds_left_out: int = 0
    distributions: dict[str, Distribution] = field(
        default_factory=lambda: {name: Distribution() for name in _NUMERIC})
    worst: list[Row] = field(default_factory=list)
    """Faces, the largest standard error first."""
    doubtful: list[Row] = field(default_factory=list)
    """Faces, the least sure first."""
    slowest: list[Row] = field(default_factory=list)
    """Frames, the slowest first."""
    spread: list[Row] = field(default_factory=list)
    """Some of all faces, the largest standard error first."""


class _Top:
    """The rows with the largest values, and where they are."""

    def __init__(self, most: int) -> None:
        self._most = most
        self.found: list[tuple[float, tuple[int, int]]] = []

    def add(self, values: NDArray[np.float64], group: int) -> None:
        """Look at a group's values; NaN is none."""
        known = np.flatnonzero(~np.isnan(values))
        most = known[np.argsort(-values[known], kind="stable")[:self._most]]
        more = [(float(values[row]), (group, int(row))) for row in most]
        # Of equal ones the first in the file.
        self.found = sorted(
            self.found + more, key=lambda one: (-one[0], one[1]))[:self._most]

    @property
    def places(self) -> list[tuple[int, int]]:
        return [place for _, place in self.found]


class _Gathering:
    def __init__(self) -> None:
        self.figures = Figures()
        self.worst, self.doubtful, self.slowest = _Top(_WORST), _Top(_WORST // 2), _Top(_WORST // 2)
        self.spread = _Top(_SPREAD)
        self._kinds: dict[tuple[State, str], Kind] = {}
        self._last_source: str | None = None

    def add(self, table: pa.Table, group: int) -> None:
        """Count a group of rows."""
        figures = self.figures
        figures.rows += len(table)
        self._add_sources(table.column("source").combine_chunks())
        state = np.asarray(table.column("state").to_pylist())
        for one, count in zip(*np.unique(state, return_counts=True), strict=True):
            figures.states[one] += int(count)
        figures.retried += int((_numbers(table, "attempts") > 1).sum())
        _count(figures.warnings, table.column("warnings").combine_chunks().flatten().to_pylist())
        faces = state == "face"
        for name, values in _quantities(table, faces):
            figures.distributions[name].add(values)
        seconds = _numbers(table, "seconds")
        figures.seconds += float(seconds.sum())
        self.slowest.add(seconds, group)
        self.worst.add(np.where(faces, _numbers(table, "sigma_mm"), np.nan), group)
        self.doubtful.add(np.where(faces, -_numbers(table, "face_score"), np.nan), group)
        # Faces by lot, the same ones each time that the page is made.
        lots = np.random.default_rng(group).random(len(table))
        self.spread.add(np.where(faces, lots, np.nan), group)
        self._add_errors(table, np.flatnonzero(~faces), group)

    def _add_sources(self, source: pa.StringArray) -> None:
        """The file is sorted by them."""
        if not len(source):
            return
        self.figures.sources += int(
            np.count_nonzero(np.asarray(pc.not_equal(source[:-1], source[1:]))))
        self.figures.sources += source[0].as_py() != self._last_source
        self._last_source = source[-1].as_py()

    def _add_errors(self, table: pa.Table, places: NDArray[np.intp], group: int) -> None:
        columns = table.select(("source", "state", "error", "why")).take(places).to_pydict()
        for row, source, state, error, why in zip(places, *columns.values(), strict=True):
            key = state, error
            if key not in self._kinds and len(self._kinds) >= _MOST_TEXTS:
                self.figures.kinds_left_out += 1
                continue
            kind = self._kinds.setdefault(key, Kind(state, error))
            kind.count += 1
            alike = _NUMBERS.sub("#", why.replace(source, "#"))
            if len(kind.said) >= _MOST_TEXTS and alike not in kind.said:
                kind.said = {one: text for one, text in kind.said.items() if text in kind.reasons}
            reason = kind.said.setdefault(alike, why or error)
            new = reason not in kind.reasons or source != kind.last_source
            kept = kind.places if new else kind.spare
            if len(kept) < _EXAMPLES:
                kept.append((group, int(row)))
            kind.last_source = source
            _count(kind.reasons, [reason])

    def kinds(self) -> list[Kind]:
        """Give the most frequent kinds of errors."""
        found = sorted(self._kinds.values(), key=lambda one: (-one.count, one.state, one.error))
        self.figures.kinds_left_out += sum(one.count for one in found[_MOST_KINDS:])
        return found[:_MOST_KINDS]


def gather(file: SummaryFile) -> Figures:
    """Read all of a summary; CorruptFileError where it is damaged."""
    columns = ("source", "frame", "state", "error", "why", "attempts", "warnings", *_NUMERIC)
    gathering = _Gathering()
    for group, table in enumerate(file.each_group(columns)):
        gathering.add(table, group)
    figures = gathering.figures
    for quantity in QUANTITIES:
        figures.distributions[quantity.column].draw_bars(whole=not quantity.digits)
    for table in file.each_group(("state", *_NUMERIC)):
        faces = np.asarray(table.column("state").to_pylist()) == "face"
        for name, values in _quantities(table, faces):
            figures.distributions[name].add_to_bars(values)
    figures.kinds = gathering.kinds()
    for kind in figures.kinds:
        kind.places = sorted((kind.places + kind.spare)[:_EXAMPLES])
    tops = gathering.worst, gathering.doubtful, gathering.slowest, gathering.spread
    wanted = {place for top in tops for place in top.places}
    wanted |= {place for kind in figures.kinds for place in kind.places}
    rows = dict(_rows_at(file, wanted))
    for kind in figures.kinds:
        kind.examples = [rows[place] for place in kind.places]
        kind.reasons = Counter(dict(kind.reasons.most_common(_REASONS)))
    figures.warnings = Counter(dict(figures.warnings.most_common(_MOST_KINDS)))
    figures.worst, figures.doubtful, figures.slowest, figures.spread = (
        [rows[place] for place in top.places] for top in tops)
    figures.spread.sort(key=lambda row: -(row.sigma_mm or 0.0))
    return figures


def _rows_at(
    file: SummaryFile, places: Iterable[tuple[int, int]]
) -> Iterator[tuple[tuple[int, int], Row]]:
    by_group: dict[int, list[int]] = {}
    for group, row in sorted(places):
        by_group.setdefault(group, []).append(row)
    for group, numbers in by_group.items():
        found = rows_of(file.group(group).take(numbers))
        yield from (((group, number), row) for number, row in zip(numbers, found, strict=True))


def _quantities(
    table: pa.Table, faces: NDArray[np.bool_]
) -> Iterator[tuple[str, NDArray[np.float64]]]:
    for name in _NUMERIC:
        values = _numbers(table, name)
        kept = ~np.isnan(values) if name == "seconds" else faces & ~np.isnan(values)
        yield name, values[kept]


def _numbers(table: pa.Table, name: str) -> NDArray[np.float64]:
    """Give a column; null is NaN."""
    column = table.column(name).cast(pa.float64())
    return np.asarray(column.to_numpy(zero_copy_only=False), np.float64)


def _count(counter: Counter[str], texts: Iterable[str]) -> None:
    counter.update(texts)
    if len(counter) > _MOST_TEXTS:
        for text, _ in counter.most_common()[_MOST_TEXTS // 2:]:
            del counter[text]
