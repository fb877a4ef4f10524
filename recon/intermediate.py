"""What one stage hands to the next."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ColorSampler", "Registration"]

ColorSampler = Callable[[NDArray[np.float32]], tuple[NDArray[np.uint8], NDArray[np.bool_]]]
"""Points, (n, 3) float32, mm, to their colours, (n, 3) uint8, and which are seen, (n,) bool."""


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
    colors : (H, W, 3) uint8, RGB, bilinear; zero where not `visible`, or not looked up
    pitch : side of the z-buffer's cells, pixels of the colour image
    nearest : (rows, columns) float32, mm, the z-buffer: nearest z in the colour camera's frame in
        each cell and the cells around it, 1e30 where nothing
    """

    rows: slice
    columns: slice
    focal_px: float
    points: NDArray[np.float32]
    valid: NDArray[np.bool_]
    pixels: NDArray[np.float32]
    color_depth: NDArray[np.float32]
    visible: NDArray[np.bool_]
    colors: NDArray[np.uint8]
    pitch: float
    nearest: NDArray[np.float32]
