"""Pages of one file: words, tables, pictures and histograms, without anything from elsewhere."""

import base64
from collections.abc import Iterable, Sequence
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Curve", "histogram", "page", "picture", "table"]

_STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; color: #181a1c; background: #fff; margin: 2rem auto;
  max-width: 66rem; padding: 0 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
table { border-collapse: collapse; margin: .5rem 0; }
th, td { border: 1px solid #ccd0d4; padding: .25rem .6rem; text-align: right; }
th:first-child, td:first-child { text-align: left; }
th { background: #f2f4f6; } img, svg { max-width: 100%; height: auto; }
figure { margin: 1rem 0; } figcaption, .note { color: #50565c; font-size: .9rem; }
.scroll { overflow-x: auto; }
""".strip()
_WIDE, _HIGH, _LEFT, _BELOW, _TOP = 720, 260, 52, 40, 12
"""Of a histogram and of its margins, pixels."""


class Curve(NamedTuple):
    """A line over a histogram."""

    name: str
    shares: NDArray[np.float64]
    """Per mm, of each bin."""
    color: str


def page(title: str, parts: Iterable[str]) -> bytes:
    """Give an HTML file of parts that are HTML already."""
    return "\n".join([
        '<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(title)}</title>", f"<style>{_STYLE}</style></head><body>",
        f"<h1>{escape(title)}</h1>", *parts, "</body></html>", ""]).encode(
            "utf-8", "backslashreplace")


def picture(png: bytes, caption: str) -> str:
    """Give a picture with a caption, which is its text for those who do not see it, too."""
    data = base64.b64encode(png).decode()
    return (f'<figure><img alt="{escape(caption)}" src="data:image/png;base64,{data}">'
            f"<figcaption>{escape(caption)}</figcaption></figure>")


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Give a table of texts."""
    def cells(kind: str, texts: Sequence[str]) -> str:
        return "".join(f"<{kind}>{escape(text)}</{kind}>" for text in texts)

    lines = [f"<tr>{cells('td', row)}</tr>" for row in rows]
    return (f'<div class="scroll"><table><thead><tr>{cells("th", head)}</tr></thead>'
            f"<tbody>{''.join(lines)}</tbody></table></div>")


def histogram(
    edges: NDArray[np.float64], shares: NDArray[np.float64], *, x: str, colors: Sequence[str],
    curves: Sequence[Curve] = (), unit_mm: float = 1.0,
) -> str:
    """Draw shares per mm, (n,), between edges, (n + 1,), as SVG; a colour for each bar.

    unit_mm : length that the shares at the axis are said for
    """
    top = max(float(shares.max(initial=0)), *(float(curve.shares.max()) for curve in curves),
              1e-9) * 1.08
    across = (_WIDE - _LEFT - 12) / (edges[-1] - edges[0])
    up = (_HIGH - _BELOW - _TOP) / top

    def at_x(value: float) -> float:
        return float(_LEFT + (value - edges[0]) * across)

    def at_y(value: float) -> float:
        return float(_HIGH - _BELOW - value * up)

    parts = [f'<svg viewBox="0 0 {_WIDE} {_HIGH}" role="img" width="{_WIDE}" height="{_HIGH}" '
             f'xmlns="http://www.w3.org/2000/svg" aria-label="histogram: {escape(x)}" '
             'font-family="sans-serif" font-size="12">']
    parts += [f'<rect x="{at_x(low):.1f}" y="{at_y(share):.1f}" '
              f'width="{max((high - low) * across - 0.6, 0.4):.1f}" height="{share * up:.1f}" '
              f'fill="{color}" stroke="#7d848a" stroke-width="0.4"/>'
              for low, high, share, color in zip(edges, edges[1:], shares, colors, strict=False)]
    middles = (edges[:-1] + edges[1:]) / 2
    for number, curve in enumerate(curves):
        points = " ".join(f"{at_x(m):.1f},{at_y(s):.1f}"
                          for m, s in zip(middles, curve.shares, strict=True))
        parts.append(f'<polyline points="{points}" fill="none" stroke="{curve.color}" '
                     'stroke-width="2"/>')
        parts.append(f'<text x="{_WIDE - 16}" y="{_TOP + 14 + 16 * number}" text-anchor="end" '
                     f'fill="{curve.color}">{escape(curve.name)}</text>')
    base = _HIGH - _BELOW
    parts.append(f'<line x1="{_LEFT}" y1="{base}" x2="{_WIDE - 12}" y2="{base}" stroke="#181a1c"/>')
    parts += [f'<text x="{at_x(value):.1f}" y="{base + 16}" text-anchor="middle">{value:g}</text>'
              for value in np.linspace(edges[0], edges[-1], 9 if edges[0] < 0 else 12)]
    parts += [f'<text x="{_LEFT - 6}" y="{at_y(share) + 4:.1f}" text-anchor="end">'
              f"{100 * share * unit_mm:.0f} %</text>" for share in (top / 2, top / 1.08)]
    parts.append(f'<text x="{(_LEFT + _WIDE) / 2:.0f}" y="{_HIGH - 6}" text-anchor="middle">'
                 f"{escape(x)}; share of the points per {unit_mm:g} mm</text></svg>")
    return "".join(parts)
