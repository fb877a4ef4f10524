"""Whether a frame's depth and colour belong together, measured on the frame itself.

A surface that ends before something farther shows in both images: as a step in depth and, mostly,
as an edge in colour. Where the calibration takes the steps is compared with where the edges are,
under what the frame says of itself and under what may be wrong with it
(docs/decisions/0034-depth-and-colour-belong-together.md).
"""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from denseface.capture.agreement._edges import Edges, find_edges
from denseface.capture.agreement._hypotheses import (
    NO_CORRECTION,
    Correction,
    hypotheses,
)
from denseface.capture.agreement._outlines import Outlines, find_outlines
from denseface.capture.agreement._scores import best_shift, measure_fit
from denseface.capture.agreement._shadow import shadow_side
from denseface.capture.frame import RgbdFrame

__all__ = ["Agreement", "Verdict", "measure_agreement"]

_FEWEST_OUTLINES = 150
"""Samples of outlines, with fewer of which nothing is said."""
_LEAST_SIDE = 60
"""Pixels: of smaller images nothing is said."""
_LEAST_CLEAR = 0.01
"""Share of the colour image on clear edges, with less of which nothing is said."""
_FITS = 3.6
"""Score of what fits. Of 69 right frames, simulated and real, the least has 4.2."""
_CLEARLY, _BARELY = 1.8, 1.0
"""By how much one hypothesis must be better than another, and one that is likely beforehand."""
_NOWHERE = 2.6
"""Where no hypothesis reaches this, on many outlines, nothing fits."""
_MANY_OUTLINES, _MUCH_CLEAR = 500, 0.05
"""Outlines and edges with which nothing may fit."""
_NEAREST, _NEAREST_PERCENTILE = 1.15, 10
"""What lies up to so many times as far as that percentile of the outlines' depths is nearest."""
_SAME_PX = 3.0
"""Hypotheses whose outlines are seen no farther apart, in the median, are one."""


class Verdict(StrEnum):
    """What was found."""

    UNKNOWN = "unknown"
    """Too few outlines or edges to say anything."""
    AGREES = "agrees"
    CORRECTED = "corrected"
    """One fault is clearly the case, and was put right."""
    DOUBTFUL = "doubtful"
    """Something is wrong that cannot be put right for sure."""
    REFUSED = "refused"
    """There is enough to see, and nothing fits."""


@dataclass(frozen=True)
class Agreement:
    """What was measured on a frame, and what follows.

    Attributes
    ----------
    verdict : what was found
    correction : how such frames are put right; empty but for CORRECTED
    note : one line for who uses the frame; empty where there is nothing to say
    scores : for each hypothesis, by its fault ("" for none), how improbable its fit by chance is,
        in standard deviations
    samples : of the outlines
    offset_px : (u, v) by which the edges of what is nearest lie beside its outlines, pixels of the
        colour image; (0, 0) where they do not
    """

    verdict: Verdict
    correction: Correction = NO_CORRECTION
    note: str = ""
    scores: tuple[tuple[str, float], ...] = ()
    samples: int = 0
    offset_px: tuple[int, int] = (0, 0)

    @property
    def lasting_note(self) -> str:
        """The note, where it holds for all frames of a source and not for what moved in one."""
        moved = self.offset_px != (0, 0) or self.verdict is Verdict.REFUSED
        return "" if moved else self.note

    def means_the_same(self, other: "Agreement") -> bool:
        """Say whether the same follows for a source's frames."""
        refused = [one.verdict is Verdict.REFUSED for one in (self, other)]
        return self.correction == other.correction and refused[0] == refused[1]


def measure_agreement(frame: RgbdFrame) -> Agreement:
    """Measure whether depth and colour of a frame belong together, in about 20 ms.

    A frame whose outlines or edges are too few, as of an empty wall or in the dark, and one without
    colour are UNKNOWN.
    """
    if frame.color is None or min(*frame.depth.shape, *frame.color.shape[:2]) < _LEAST_SIDE:
        return Agreement(Verdict.UNKNOWN)
    outlines = find_outlines(frame.depth, frame.depth_meaning.unit_um / 1000)
    edges = find_edges(frame.color, frame.calibration.color)
    if len(outlines) < _FEWEST_OUTLINES or edges.clear < _LEAST_CLEAR:
        return Agreement(Verdict.UNKNOWN, samples=len(outlines))
    return _Measured(frame, outlines, edges).judged()


class _Measured:
    def __init__(self, frame: RgbdFrame, outlines: Outlines, edges: Edges) -> None:
        self.frame, self.outlines, self.edges = frame, outlines, edges
        self.shadow = shadow_side(outlines, frame.depth_camera)
        self.seen = {one: one.seen_at(outlines, frame) for one in hypotheses(frame)}
        self.scores = {one: measure_fit(edges, outlines, uv).score
                       for one, uv in self.seen.items()}
        self.stated = next(iter(self.seen))

    def judged(self) -> Agreement:
        best, rival = self._best()
        offset = self._offset(best)
        if offset != (0, 0):
            return self._agreement(
                Verdict.DOUBTFUL, f"the colour of what is nearest lies {offset[0]}, {offset[1]} "
                "pixels (right, down) beside its depth: taken at another moment, or with another "
                "calibration", offset_px=offset)
        if rival:
            return self._agreement(Verdict.DOUBTFUL, "depth and colour do not belong together: "
                                   f"{best.fault}, or {rival.fault}")
        if best is not self.stated:
            return self._agreement(Verdict.CORRECTED, f"{best.fault}: corrected", best)
        if self.scores[best] >= _FITS:
            if self.shadow > 0 and self._may_be_mirrored():
                return self._agreement(
                    Verdict.DOUBTFUL, "shadows of depth lie to the right of what casts them, in "
                    "images of a Kinect or Xtion to the left: they may be mirrored")
            return self._agreement(Verdict.AGREES)
        if (max(self.scores.values()) < _NOWHERE and len(self.outlines) >= _MANY_OUTLINES
                and self.edges.clear >= _MUCH_CLEAR):
            return self._agreement(
                Verdict.REFUSED, "depth and colour do not belong together: no edge in colour is "
                "where depth breaks off, nor would be if depth were registered or not, an image "
                "mirrored or the pose another")
        return self._agreement(Verdict.UNKNOWN)

    def _best(self) -> tuple[Correction, Correction | None]:
        """Give what fits best, and what fits as well but means something else.

        What the frame says is the best unless another fits clearly better.
        """
        ranked = self._better()
        if not ranked:
            return self.stated, None
        alike = max(map(self.scores.__getitem__, ranked)) - _CLEARLY
        ranked = [one for one in ranked if self.scores[one] > alike]
        best = max(ranked, key=lambda one: (one.likely, self.scores[one]))
        rivals = [one for one in ranked if one.likely >= best.likely
                  and one is not best and not self._same(one, best)]
        return best, max(rivals, key=self.scores.__getitem__, default=None)

    def _offset(self, best: Correction) -> tuple[int, int]:
        """Say how far the nearest is off, unless another hypothesis than the stated is better.

        Where a person moved between depth and colour, another pose may fit the person better, but
        not what stands behind.
        """
        if best.likely:
            return 0, 0
        z = self.outlines.z_mm
        near = z < _NEAREST * np.percentile(z, _NEAREST_PERCENTILE)
        if best is not self.stated:
            rest = self.outlines.among(~near)
            as_stated, other = (measure_fit(self.edges, rest, self.seen[one][~near]).score
                                for one in (self.stated, best))
            if as_stated < max(_FITS, other):
                return 0, 0
        return best_shift(self.edges, self.outlines.among(near), self.seen[self.stated][near])

    def _may_be_mirrored(self) -> bool:
        return any(self.scores[one] > self.scores[self.stated] - _CLEARLY
                   for one in self.scores if one.turn_depth)

    def _better(self) -> list[Correction]:
        """Give what fits clearly better than what the frame says."""
        stated = self.scores[self.stated]
        return [one for one, score in self.scores.items()
                if score >= max(_FITS, stated + (_BARELY if one.likely else _CLEARLY))
                and not self._same(one, self.stated)
                and not (self.shadow and one.turn_depth == (self.shadow < 0))]

    def _same(self, one: Correction, other: Correction) -> bool:
        """Say whether two hypotheses mean the same but for their names."""
        if (one.turn_depth, one.turn_color) != (other.turn_depth, other.turn_color):
            return False
        apart = np.hypot(*(self.seen[one] - self.seen[other]).T)
        return bool(np.nanmedian(apart) < _SAME_PX)

    def _agreement(self, verdict: Verdict, note: str = "", correction: Correction = NO_CORRECTION,
                   offset_px: tuple[int, int] = (0, 0)) -> Agreement:
        return Agreement(verdict, correction, note,
                         tuple((one.fault, score) for one, score in self.scores.items()),
                         len(self.outlines), offset_px)
