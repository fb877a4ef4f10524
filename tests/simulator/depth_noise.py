"""What a kind of depth sensor adds to the truth."""

from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray

from denseface.capture.frame import DepthMeaning, DepthRounding

__all__ = ["KINECT_V1", "DepthNoise", "Edges", "Levels"]

_CUT = DepthMeaning(rounding=DepthRounding.CUT)


class Edges(StrEnum):
    """What a pixel at a depth edge shows."""

    BLOCKS = "blocks"
    """One side or the other, several pixels alike: a matching window's choice."""
    MIXED = "mixed"
    """A depth between both sides: light of both came back to the pixel."""


class Levels(StrEnum):
    """Which depths a sensor can report, before they become whole counts."""

    SHIFT = "shift"
    """Those of a PrimeSense's whole shift numbers."""
    DISPARITY = "disparity"
    """Whole fractions of a pixel of disparity, `DepthNoise.disparity_step` apart."""
    ANY = "any"
    """Any."""


@dataclass(frozen=True)
class DepthNoise:
    """What differs from the true depth.

    Attributes
    ----------
    axial : (a, b, c): a + b max(z - c, 0)^2 is the standard deviation along z, mm, z in m
    spectrum : (share of the axial variance, its correlation length in pixels), shares add up to 1
    steady_share : of the axial variance, the same in each frame of a still scene
    jitter_px, jitter_correlation_px : how far aside a pixel looks, standard deviation, and how
        many pixels do so alike
    edges : what pixels at depth edges show
    edge_px, edge_correlation_px, edge_reach_px : of `Edges.BLOCKS`: how far aside they look, in
        blocks of what size, how far from the edge
    levels : which depths there are
    disparity_step : of `Levels.DISPARITY`, from level to level, 1 / mm
    meaning : what a count of the depth image is
    shadows : a projector or second camera is needed, which does not see everything
    grazing : cosine of incidence: never a reading below the first, always above the second
    """

    axial: tuple[float, float, float]
    spectrum: tuple[tuple[float, float], ...]
    steady_share: float = 0.22
    jitter_px: float = 0.5
    jitter_correlation_px: float = 1.3
    edges: Edges = Edges.BLOCKS
    edge_px: float = 1.2
    edge_correlation_px: float = 2.6
    edge_reach_px: int = 4
    levels: Levels = Levels.SHIFT
    disparity_step: float = 0.0
    meaning: DepthMeaning = _CUT
    shadows: bool = True
    grazing: tuple[float, float] = (0.10, 0.28)

    def axial_mm(self, depth_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """Give the axial noise, mm, standard deviation, at depths in mm."""
        a, b, c = self.axial
        z = np.asarray(depth_mm, np.float64) / 1000
        return a + b * np.maximum(z - c, 0) ** 2

    def to_counts(self, depth_mm: NDArray[np.floating]) -> NDArray[np.float64]:
        """Round depths, mm, to levels (shift numbers aside) and to counts, as float64."""
        depth = np.asarray(depth_mm, np.float64)
        if self.levels is Levels.DISPARITY:
            depth = 1 / (np.maximum(np.rint(1 / np.maximum(depth, 1) / self.disparity_step), 1)
                         * self.disparity_step)
        counts = depth * (1000 / self.meaning.unit_um)
        cut = self.meaning.rounding is DepthRounding.CUT
        return np.floor(counts) if cut else np.rint(counts)


KINECT_V1 = DepthNoise(
    axial=(1.17, 2.0, 0.65), spectrum=((0.18, 0.0), (0.46, 1.4), (0.36, 3.1)), steady_share=0.22)
"""A Kinect v1, as a real recording of one shows it.

Its spectrum gives, with the quantiser's own noise, the recording's correlation over 1, 2, 4, 6, 8
pixels (0.64, 0.45, 0.24, 0.11, 0.05), as the mean of its bands at 0.55-0.75 and 1.0-1.5 m; between
them a person moves. The steady share is what Nguyen's total (1.37 mm at 0.7 m) leaves beside the
recording's variance over time (1.22 mm).
"""
