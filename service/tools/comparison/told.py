"""What is said of a comparison: lines, JSON, a picture, a page, a coloured cloud."""

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from html import escape
from importlib.metadata import version

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.service.tools.comparison.comparing import Comparison
from denseface.service.tools.comparison.significance import Change, Verdict
from denseface.service.tools.comparison.surface import Surface
from denseface.service.tools.picturing import views
from denseface.service.tools.picturing.page import histogram, page, picture, table

__all__ = ["ENDINGS", "Told"]

ENDINGS = (".html", ".json", ".png", ".ply")
"""Of what is written."""
_TURNS_DEG = (-45.0, 0.0, 45.0)
_TURNED_STEP_MM = 1.8
"""Points are so wide in a turned view, where those of steep parts lie farther apart."""
_VIEW = (330, 420)
"""Width and height of a view, pixels."""
_BETWEEN_MM = 6.0
"""Values are taken from places no farther than this."""
_MOST_MM, _BINS = 5.0, 60
"""A histogram ends there at most."""
_LIMITS = ("Sides are in the first face's camera frame: x right, y down, z forward, mm; positive "
           "where the second face stands out of the first. Left and right are the person's own.")
_HONEST = ("Significance holds for the whole face at once. It rests on the noise that the "
           "differences themselves show, and on repeats of unchanged heads before simulated "
           "sensors (docs/compare.md): an error that keeps its place and differs between "
           "the sides, as of another sensor, another calibration, another expression, hair or "
           "glasses, looks like a change and is not told from one.")


@dataclass(frozen=True, eq=False)
class Told:
    """A comparison with what it is called.

    Attributes
    ----------
    result : the comparison
    surface : the first side's first capture
    before, after : where the captures of each side come from
    """

    result: Comparison
    surface: Surface
    before: Sequence[str]
    after: Sequence[str]

    def bytes_of(self, ending: str) -> bytes:
        """Give a file of one of `ENDINGS`."""
        return {".html": self._html, ".json": self._json, ".png": self._png,
                ".ply": self._ply}[ending]()

    def lines(self) -> list[str]:
        """Give what is said on the terminal."""
        result, numbers = self.result, self.result.numbers
        rest = [one for one in result.aligned if one is not None]
        lines = [
            f"{_count(len(self.before), 'capture')} and {_count(len(self.after), 'capture')}, laid "
            f"on the first within {max(one.rms_mm for one in rest):.2f} mm (RMS), overlap "
            f"{100 * min(one.overlap for one in rest):.0f} %",
            f"differences at {numbers.places:,} places: mean {numbers.mean_mm:+.2f} mm, median "
            f"{numbers.median_mm:+.2f} mm, RMS {numbers.rms_mm:.2f} mm, 95 % within "
            f"{numbers.within_95_mm:.2f} mm, {100 * numbers.beyond:.1f} % beyond "
            f"{numbers.beyond_mm:g} mm"]
        verdict = result.verdict
        if verdict is None:
            return [*lines, "too little of the face is on both sides to say what changed"]
        if not verdict.changes:
            return [*lines, f"no change at {_percent(verdict)} confidence; {_finds(verdict)}"]
        return [*lines,
                f"changed, at {_percent(verdict)} confidence for the whole face; "
                f"{_finds(verdict)}:",
                *(f"  {number}  {self._sentence(change)}"
                  for number, change in enumerate(verdict.changes, 1))]

    def _sentence(self, change: Change) -> str:
        x, y, z = self.result.sites.points[change.peak]
        how = "stands out" if change.mean_mm > 0 else "lies back"
        return (f"{self.result.names[change.peak]} at ({x:.0f}, {y:.0f}, {z:.0f}) mm: {how} by "
                f"{abs(change.mean_mm):.2f} ± {change.half_mm:.2f} mm over "
                f"{change.area_mm2:.0f} mm², at most {abs(change.peak_mm):.2f} mm, "
                f"{change.width_mm:.0f} mm wide")

    def _json(self) -> bytes:
        result, verdict = self.result, self.result.verdict
        known = np.isfinite(result.difference)
        told = {
            "generator": f"denseface {version('denseface')}",
            "before": list(self.before), "after": list(self.after),
            "frame": "the first capture's depth camera: x right, y down, z forward, mm",
            "numbers": asdict(result.numbers),
            "alignments": [None if one is None else {
                "rotation": one.pose.rotation.round(8).tolist(),
                "shift_mm": one.pose.shift.round(4).tolist(),
                "turned_deg": round(one.pose.angle_deg, 3), "rms_mm": round(one.rms_mm, 4),
                "overlap": round(one.overlap, 4)} for one in result.aligned],
            "confidence": None if verdict is None else verdict.confidence,
            "noise_mm": None if verdict is None else round(verdict.noise_mm, 4),
            "noise_length_mm": None if verdict is None else round(verdict.length_mm, 3),
            "finds_20_mm_wide_from_mm": None if verdict is None else round(verdict.finds_mm, 3),
            "changes": [] if verdict is None else [self._record(one) for one in verdict.changes],
            "by_region": self._regions(known),
            "warnings": list(result.warnings),
        }
        return (json.dumps(told, indent=2, allow_nan=False) + "\n").encode()

    def _record(self, change: Change) -> dict[str, object]:
        return {
            "region": str(self.result.names[change.peak]),
            "place_mm": self.result.sites.points[change.peak].round(2).tolist(),
            "mean_mm": round(change.mean_mm, 4), "half_interval_mm": round(change.half_mm, 4),
            "peak_mm": round(change.peak_mm, 4), "area_mm2": round(change.area_mm2, 1),
            "width_mm": round(change.width_mm, 2), "score": round(change.score, 4)}

    def _regions(self, known: NDArray[np.bool_]) -> dict[str, dict[str, float | int]]:
        """Give the differences of each named part of the face."""
        found: dict[str, dict[str, float | int]] = {}
        for name in sorted(set(self.result.names[known].tolist())):
            values = self.result.difference[known & (self.result.names == name)]
            found[name] = {"places": len(values), "mean_mm": round(float(values.mean()), 4),
                           "rms_mm": round(float(np.sqrt((values**2).mean())), 4)}
        return found

    def _spread(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Take values from the places to the surface's points: NaN where none is near."""
        known = np.isfinite(values)
        out = np.full(len(self.surface), np.nan)
        if known.sum() < 4:
            return out
        away, near = self.result.sites.rows(known).nearest(self.surface.points, 4, _BETWEEN_MM)
        there = np.isfinite(away[:, 0])
        weight = np.where(np.isfinite(away), 1 / (away + 0.3) ** 2, 0)[there]
        inside = np.append(values[known], 0.0)[near[there]]
        out[there] = (weight * inside).sum(axis=1) / weight.sum(axis=1)
        return out

    @property
    def _limit(self) -> float:
        return views.nice_limit(max(self.result.numbers.within_95_mm, 0.2))

    def _shown(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Give the surface's points and normals, the head looking straight ahead."""
        back = self.result.place.pose.inverse
        return back.of(self.surface.points), self.surface.normals @ back.rotation.T

    def _strip(self, values: NDArray[np.float64], marks: Sequence[views.Mark]
               ) -> NDArray[np.uint8]:
        points, normals = self._shown()
        colors = views.diverging(self._spread(values), self._limit)
        row = np.concatenate([views.view(
            points, normals, colors, turn_deg=turn, size=_VIEW,
            step_mm=1.0 if turn == 0 else _TURNED_STEP_MM, marks=marks if turn == 0 else ())
            for turn in _TURNS_DEG], axis=1)
        words = (f"-{self._limit:g} mm: lies back", "0",
                 f"+{self._limit:g} mm: stands out")
        return np.concatenate([row, views.legend(self._limit, row.shape[1], words)])

    def _changed(self) -> NDArray[np.float64]:
        """Give the differences where they are significant, 0 where judged and not, else NaN."""
        verdict = self.result.verdict
        if verdict is None:
            return np.full(len(self.result.difference), np.nan)
        out = np.where(np.isfinite(verdict.score), 0.0, np.nan)
        for change in verdict.changes:
            out[change.rows] = self.result.difference[change.rows]
        return out

    def _marks(self) -> list[views.Mark]:
        verdict, back = self.result.verdict, self.result.place.pose.inverse
        return [] if verdict is None else [
            views.Mark(back.of(self.result.sites.points[[change.peak]])[0],
                       max(np.sqrt(change.area_mm2 / np.pi), change.width_mm / 2), str(number))
            for number, change in enumerate(verdict.changes, 1)]

    def _png(self) -> bytes:
        all_of_it = self._strip(self.result.difference, self._marks())
        changed = self._strip(self._changed(), self._marks())
        titles = ("differences", "what changed: grey where nothing can be said")
        bands = []
        for title, strip in zip(titles, (all_of_it, changed), strict=True):
            band = np.full((34, strip.shape[1], 3), 255, np.uint8)
            cv2.putText(band, title, (20, 24), cv2.FONT_HERSHEY_SIMPLEX, 0.6, (24, 26, 28), 1,
                        cv2.LINE_AA)
            bands += [band, strip]
        return views.encode_png(np.concatenate(bands))

    def _html(self) -> bytes:
        result, verdict = self.result, self.result.verdict
        values = result.difference[np.isfinite(result.difference)]
        reach = min(max(float(np.percentile(np.abs(values), 99.5)), 0.25), _MOST_MM)
        reach = float(np.ceil(reach * 4) / 4)
        edges = np.linspace(-reach, reach, _BINS + 1)
        shares = np.histogram(values, edges)[0] / (len(values) * np.diff(edges))
        middles = (edges[:-1] + edges[1:]) / 2
        colors = ["#{:02x}{:02x}{:02x}".format(*color)
                  for color in views.diverging(middles, self._limit).tolist()]
        first, *rest = self.lines()
        parts = [
            f"<p>{_joined(self.before)} &#8594; {_joined(self.after)}</p>",
            *(f"<p>{escape(line)}</p>" for line in (first, *rest)),
            *(f'<p class="note">warning: {escape(line)}</p>' for line in result.warnings)]
        if verdict is not None and verdict.changes:
            parts.append(table(
                ("change", "where", "x, y, z, mm", "mean, mm", "95 % interval"
                 if verdict.confidence == 0.95 else "interval", "most, mm", "area, mm²",
                 "width, mm"),
                [(str(number), str(result.names[one.peak]),
                  ", ".join(f"{value:.0f}" for value in result.sites.points[one.peak]),
                  f"{one.mean_mm:+.2f}", f"± {one.half_mm:.2f}", f"{one.peak_mm:+.2f}",
                  f"{one.area_mm2:.0f}", f"{one.width_mm:.0f}")
                 for number, one in enumerate(verdict.changes, 1)]))
        marks = self._marks()
        parts += [
            picture(views.encode_png(self._strip(result.difference, marks)),
                    "Differences, along the first face's normals: blue where the second face lies "
                    "back, red where it stands out, grey where one side has nothing"),
            picture(views.encode_png(self._strip(self._changed(), marks)),
                    "What changed: the differences that are significant; grey where nothing can "
                    "be said: rims, hair, what is steep"),
            histogram(edges, shares, x="difference, mm", colors=colors, unit_mm=0.1),
            "<h2>By part of the face</h2>",
            table(("part", "places", "mean, mm", "RMS, mm"), [
                (name, f"{one['places']:,}", f"{one['mean_mm']:+.2f}", f"{one['rms_mm']:.2f}")
                for name, one in self._regions(np.isfinite(result.difference)).items()]),
            f'<p class="note">{escape(_LIMITS)}</p>', f'<p class="note">{escape(_HONEST)}</p>',
            f'<p class="note">denseface {version("denseface")}</p>']
        return page("Two faces compared", parts)

    def _ply(self) -> bytes:
        values, score = self._spread(self.result.difference), np.full(len(self.surface), np.nan)
        if self.result.verdict is not None:
            score = self._spread(self.result.verdict.score)
        colors = views.diverging(values, self._limit)
        table_ = np.zeros(len(self.surface), [
            *((name, "<f4") for name in ("x", "y", "z", "nx", "ny", "nz")),
            *((name, "u1") for name in ("red", "green", "blue")),
            ("difference", "<f4"), ("score", "<f4")])
        for names, data in ((("x", "y", "z"), self.surface.points),
                            (("nx", "ny", "nz"), self.surface.normals),
                            (("red", "green", "blue"), colors)):
            for column, name in enumerate(names):
                table_[name] = data[:, column]
        table_["difference"], table_["score"] = values, score
        kinds = {"f": "float", "u": "uchar"}
        head = ["ply", "format binary_little_endian 1.0",
                f"comment denseface {version('denseface')}: differences of two faces, mm, along "
                "the normals; nan where not known",
                "comment score: over the threshold of significance; beyond 1 or -1 it changed",
                f"element vertex {len(table_)}",
                *(f"property {kinds[table_.dtype[name].kind]} {name}"
                  for name in table_.dtype.names or ()), "end_header", ""]
        return "\n".join(head).encode() + table_.tobytes()


def _finds(verdict: Verdict) -> str:
    return (f"a smooth change 20 mm wide is found 9 times in 10 from {verdict.finds_mm:.2f} mm on")


def _percent(verdict: Verdict) -> str:
    return f"{100 * verdict.confidence:g} %"


def _count(number: int, what: str) -> str:
    return f"{number} {what}{'' if number == 1 else 's'}"


def _joined(names: Sequence[str]) -> str:
    shown = [escape(name) for name in names[:4]]
    return ", ".join(shown) + (f" and {len(names) - 4} more" if len(names) > 4 else "")
