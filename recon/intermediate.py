"""What one stage hands to the next."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Bools, Bytes, Doubles, Floats
from denseface.recon.numerics.bilinear import add_resampled
from denseface.recon.support import Support

__all__ = ["NO_DEPTH_MM", "ColorSampler", "DepthReader", "Registration", "SurfaceGrid", "ZBuffer"]

NO_DEPTH_MM = np.float32(1e30)
"""z of a cell without any depth, mm. Not inf: compiled code assumes finite numbers."""

ColorSampler = Callable[[Floats], tuple[Bytes, Bools]]
"""Points, (n, 3) float32, mm, to their colours, (n, 3) uint8, and which are seen, (n,) bool."""

DepthReader = Callable[[Floats], Floats]
"""Points, (n, 3) float32, mm, to the depths that were read along their rays, (n,) float32, mm; 0
where nothing was."""


class ZBuffer(NamedTuple):
    """The nearest z in the colour camera's frame, in cells of the colour image."""

    nearest: Floats
    """(rows, columns), mm, `NO_DEPTH_MM` where nothing is."""
    pitch: float
    """Side of a cell, pixels of the colour image."""


@dataclass(frozen=True, eq=False)
class Registration:
    """A part of the depth image as points, tied to the colour image; an entry for each pixel.

    Attributes
    ----------
    rows, columns : which rows and columns of the depth image these (H, W) are
    focal_px : focal length of the depth camera, in pixels of the depth image
    points : (H, W, 3) float32, mm, depth camera frame; zero where nothing was measured
    valid : (H, W) bool, a depth was measured
    pixels : (H, W, 2) float32, (u, v) in the colour image; NaN where not `valid`
    color_depth : (H, W) float32, mm, z in the colour camera's frame; zero where not `valid`
    visible : (H, W) bool, inside the colour image and not hidden by a nearer surface
    colors : (H, W, 3) uint8, RGB, bilinear; zero where not `visible`, or not sampled
    z_buffer : each cell holds the nearest z in it and the cells around it
    """

    rows: slice
    columns: slice
    focal_px: float
    points: Floats
    valid: Bools
    pixels: Floats
    color_depth: Floats
    visible: Bools
    colors: Bytes
    z_buffer: ZBuffer


@dataclass(frozen=True, eq=False)
class SurfaceGrid:
    """A surface z = f(x, y) on the grid of its support, bilinear between the points.

    Attributes
    ----------
    values : (3, rows, columns) float32: height, mm, and slopes along x and y
    support : where the seeds support the surface, and the grid
    detailed : whether detail was added to the fit
    """

    values: Floats
    support: Support
    detailed: bool

    def sampled(self, xs: Doubles, ys: Doubles) -> Floats:
        """Give f, df/dx, df/dy on another axis-aligned grid: (k,), (m,) mm -> (3, m, k)."""
        columns, rows = self.support.coordinates(xs, ys)
        found = np.zeros((3, len(rows), len(columns)), np.float32)
        for one, known in zip(found, self.values, strict=True):
            add_resampled(one, known, rows, columns)
        return found
