"""`summary.html`: what became of an archive, from `summary.parquet` alone, in one file.

Without a script, and with nothing from elsewhere; as large for a million frames as for a thousand.
"""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from html import escape
from pathlib import Path, PurePosixPath
from urllib.parse import quote

import numpy as np

from denseface.files import write_whole
from denseface.service.errors import StoreError, UsageError
from denseface.service.runtime.terminal.progress import duration
from denseface.service.tools.batch.row import STATES, Row, State
from denseface.service.tools.batch.summary._failing import named
from denseface.service.tools.batch.summary._figures import (
    QUANTITIES,
    Distribution,
    Figures,
    Kind,
    Quantity,
    gather,
)
from denseface.service.tools.batch.summary._style import STYLE
from denseface.service.tools.batch.summary._table import SummaryFile
from denseface.service.tools.batch.summary.writer import SUMMARY, WORKSHOP, SummaryWriter
from denseface.version import VERSION

__all__ = ["PAGE", "write_html"]

PAGE = "summary.html"
_STATES: dict[State, str] = {
    "face": "face", "no_face": "no face", "unreadable": "unreadable", "failed": "failed"}
_WIDE, _HIGH, _LEFT, _BELOW, _TOP = 560, 190, 8, 26, 8
"""Of a histogram and its margins, pixels."""
_MARKS = 5
"""Numbers below a histogram."""


def write_html(folder: Path) -> Path:
    """Write the page of a folder's summary, and give its path.

    What a run that was killed had not put into `summary.parquet` is put there first.

    Raises
    ------
    UsageError
        The folder has no summary.
    CorruptFileError
        The summary is damaged, or something else.
    StoreError
        It cannot be read, or the page cannot be written.
    """
    if (folder / WORKSHOP).is_dir():
        # A run that goes on, or a folder that cannot be written: the page is of what is there.
        with suppress(UsageError, StoreError):
            SummaryWriter(folder).close()
    if not (folder / SUMMARY).exists():
        raise UsageError(f"{folder}: has no {SUMMARY}: `denseface batch INPUT... --out DIR` makes "
                         "one")
    with SummaryFile(folder / SUMMARY) as file:
        figures = gather(file)
    path = folder / PAGE
    with named(path):
        write_whole(path, [_page(figures, folder.resolve().name)])
    return path


def _page(figures: Figures, name: str) -> bytes:
    title = f"Summary of {_text(name)}"
    digest = base64.b64encode(hashlib.sha256(STYLE.encode()).digest()).decode()
    policy = f"default-src 'none'; img-src data:; style-src 'sha256-{digest}'"
    parts = [
        "<!DOCTYPE html>", '<html lang="en"><head><meta charset="utf-8">',
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        '<meta name="referrer" content="no-referrer">',
        f"<title>{title}</title><style>{STYLE}</style></head><body><main>",
        f"<h1>{title}</h1>", *_counts(figures), *_errors(figures), *_worst(figures),
        *_quality(figures), *_spread(figures), *_foot(), "</main></body></html>", ""]
    return "\n".join(parts).encode()


def _counts(figures: Figures) -> Iterable[str]:
    rows = figures.rows
    yield (f"<p>{_count(rows, 'frame')} of {_count(figures.sources, 'source')}; "
           f"{duration(figures.seconds)} of the workers' time"
           + (f"; {_count(figures.retried, 'frame')} tried more than once" if figures.retried
              else "") + ".</p>")
    if not rows:
        return
    at, bars = 0.0, []
    for state in STATES:
        wide = 1000 * figures.states[state] / rows
        bars.append(f'<rect class="{state}" x="{at:.2f}" y="0" width="{wide:.2f}" height="20"/>')
        at += wide
    said = ", ".join(f"{_STATES[state]} {_percent(figures.states[state], rows)}"
                     for state in STATES if figures.states[state])
    yield (f'<svg class="shares" viewBox="0 0 1000 20" preserveAspectRatio="none" role="img" '
           f'aria-label="{said}">{"".join(bars)}</svg>')
    yield '<ul class="states">'
    for state in STATES:
        count = figures.states[state]
        yield (f'<li><span class="key {state}"></span>{_STATES[state]} <b>{count:,}</b> '
               f"<small>{_percent(count, rows)}</small></li>")
    yield "</ul>"


def _errors(figures: Figures) -> Iterable[str]:
    if figures.kinds:
        yield "<h2>Frames without a face, by kind</h2>"
    for kind in figures.kinds:
        yield from _kind(kind)
    if figures.kinds_left_out:
        yield f"<p>And {_count(figures.kinds_left_out, 'frame')} of rarer kinds.</p>"
    if figures.warnings:
        yield "<h2>Warnings</h2>"
        yield _table(("warning", "frames"), [
            (_text(warning), f"{count:,}") for warning, count in figures.warnings.most_common()],
            "warnings")


def _kind(kind: Kind) -> Iterable[str]:
    yield (f"<h3>{_text(kind.error) or _STATES[kind.state]} <small>{_STATES[kind.state]}, "
           f"{_count(kind.count, 'frame')}</small></h3>")
    yield "<ul>"
    for reason, count in kind.reasons.most_common():
        alike = f" <small>and {count - 1:,} alike</small>" if count > 1 else ""
        yield f"<li>{_text(reason)}{alike}</li>"
    yield "</ul>"
    yield '<div class="cards">'
    yield from (_card(row, _text(row.why)) for row in kind.examples)
    yield "</div>"


def _worst(figures: Figures) -> Iterable[str]:
    if figures.worst:
        yield "<h2>The worst faces</h2><p>Those with the largest standard error first.</p>"
        yield _rows(figures.worst)
    doubtful = [row for row in figures.doubtful if row.face_score is not None]
    if doubtful:
        yield "<h3>The least sure to be a face</h3>"
        yield _rows(doubtful)
    if figures.slowest:
        yield "<h3>The slowest frames</h3>"
        yield _rows(figures.slowest)


def _rows(rows: Sequence[Row]) -> str:
    return _table(
        ("", "source", "frame", "sigma mm", "dense", "noise mm", "score", "s", "remark"),
        [(_picture(row), _source(row), "-" if row.frame is None else str(row.frame),
          _number(row.sigma_mm, 2), f"{row.dense:,}" if row.state == "face" else "-",
          _number(row.noise_mm, 2), _number(row.face_score, 2), _number(row.seconds, 2),
          _text("; ".join(row.warnings) or row.why)) for row in rows], "frames")


def _quality(figures: Figures) -> Iterable[str]:
    drawn = [(quantity, figures.distributions[quantity.column]) for quantity in QUANTITIES]
    if not any(found.count for _, found in drawn):
        return
    yield '<h2>Quality</h2><div class="figures">'
    yield from (_histogram(quantity, found) for quantity, found in drawn if found.count)
    yield "</div>"


def _histogram(quantity: Quantity, found: Distribution) -> str:
    def said(value: float) -> str:
        return f"{value:,.{quantity.digits}f}"

    unit = f" {quantity.unit}" if quantity.unit else ""
    middle, low, high = (found.quantile(share) for share in (0.5, 0.05, 0.95))
    words = (f"median {said(middle)}{unit}, of nine in ten {said(low)} to {said(high)}, "
             f"of all {said(found.least)} to {said(found.most)}")
    across = (_WIDE - 2 * _LEFT) / len(found.bars)
    up = (_HIGH - _TOP - _BELOW) / max(int(found.bars.max()), 1)
    base = _HIGH - _BELOW
    parts = [f'<rect class="bar" x="{_LEFT + number * across:.1f}" y="{base - count * up:.1f}" '
             f'width="{max(across - 1, 1):.1f}" height="{count * up:.1f}"/>'
             for number, count in enumerate(found.bars.tolist()) if count]
    parts.append(f'<line x1="{_LEFT}" y1="{base}" x2="{_WIDE - _LEFT}" y2="{base}"/>')
    ends = float(found.edges[0]), float(found.edges[-1])
    for number, value in enumerate(np.linspace(*ends, _MARKS)):
        where = ("start", *["middle"] * (_MARKS - 2), "end")[number]
        x = _LEFT + number * (_WIDE - 2 * _LEFT) / (_MARKS - 1)
        parts.append(f'<text x="{x:.0f}" y="{base + 18}" text-anchor="{where}">{said(value)}'
                     "</text>")
    outside = f" ({found.outside:,} beyond the ends)" if found.outside else ""
    return (f"<figure><figcaption><b>{escape(quantity.title)}</b><br>{words}{outside}"
            f'</figcaption><svg viewBox="0 0 {_WIDE} {_HIGH}" role="img" '
            f'aria-label="{escape(quantity.title)}: {words}">{"".join(parts)}</svg></figure>')


def _spread(figures: Figures) -> Iterable[str]:
    if figures.spread:
        yield "<h2>Faces by lot</h2><p>The largest standard error first.</p>"
        yield '<div class="cards">'
        yield from (_card(row, f"sigma {_number(row.sigma_mm, 2)} mm, {row.dense:,} points")
                    for row in figures.spread)
        yield "</div>"


def _foot() -> Iterable[str]:
    now = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    yield (f"<footer><p>Made from {SUMMARY} by denseface {_text(VERSION)}, {now}. Pictures of "
           "faces are personal data: pass this page on only as the people agreed to.</p></footer>")


def _card(row: Row, words: str) -> str:
    frame = "" if row.frame is None else f", frame {row.frame}"
    return f'<div class="card">{_picture(row)}<p>{_source(row)}{frame}</p><p>{words}</p></div>'


def _picture(row: Row) -> str:
    if not row.thumbnail:
        return '<span class="none">no picture</span>'
    kind = "webp" if row.thumbnail.startswith(b"RIFF") else "jpeg"
    place = row.source if row.frame is None else f"{row.source}, frame {row.frame}"
    return (f'<img alt="{_text(place)}" '
            f'src="data:image/{kind};base64,{base64.b64encode(row.thumbnail).decode()}">')


def _source(row: Row) -> str:
    """The source; of a face its name, as a link to what was written."""
    short = PurePosixPath(row.source).name if row.state == "face" else row.source
    name = f'<span title="{_text(row.source)}">{_text(short or row.source)}</span>'
    return name if row.output is None else f'<a href="./{quote(row.output)}">{name}</a>'


def _table(head: Sequence[str], rows: Iterable[Sequence[str]], kind: str) -> str:
    """Give a table of texts that are HTML already; a screen that is too narrow scrolls it."""
    heads = "".join(f'<th scope="col">{one}</th>' if one else "<td></td>" for one in head)
    lines = "".join(f"<tr>{''.join(f'<td>{one}</td>' for one in row)}</tr>" for row in rows)
    return (f'<div class="scroll" tabindex="0" role="group" aria-label="{kind}">'
            f'<table class="{kind}"><thead><tr>{heads}</tr></thead><tbody>{lines}</tbody>'
            "</table></div>")


def _text(text: str) -> str:
    """Escape what is from outside, also what changes the order of reading."""
    return escape("".join(one if one.isprintable() else ascii(one)[1:-1] for one in text))


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:,.{digits}f}"


def _percent(count: int, total: int) -> str:
    return f"{100 * count / total:.1f} %"


def _count(number: int, what: str) -> str:
    return f"{number:,} {what}{'' if number == 1 else 's'}"
