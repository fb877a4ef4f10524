"""Edges of a colour image, each measured by what is usual around it."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import CameraModel

__all__ = ["Edges", "find_edges"]

_WIDTH_PX = 640
"""Wider images are shrunk to this."""
_SMOOTHING_PX = 1.2
"""Standard deviation of the blur before the gradient: noise of a colour camera, JPEG's blocks."""
_AROUND_PX = 41
"""Side of the surroundings whose mean gradient is usual."""
_NOISE = 1.0
"""Gradient, grey levels a pixel, added to what is usual: noise is no edge."""
_REACH_PX = 3
"""An outline is met by an edge within half of this: depth's borders jump by a pixel."""
_CLEAR = 4.0
"""Gradient of a clear edge, grey levels a pixel."""
MARGIN_PX = 64
"""Rim of the maps, in which there is nothing."""


@dataclass(frozen=True, eq=False)
class Edges:
    """Strength of the edges, 0 to 1, with a rim of `MARGIN_PX` in which it is nan.

    Attributes
    ----------
    upright, level : (H, W) float32, edges that part left from right, and up from down
    scale : pixels of these maps for each of the colour image
    clear : share of the image's pixels on a clear edge
    """

    upright: NDArray[np.float32]
    level: NDArray[np.float32]
    scale: float
    clear: float

    def indices(self, uv: NDArray[np.floating]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Find (n, 2) pixels of the colour image in the raveled maps.

        Returns
        -------
        (k,) indices of those inside the image, and (n,) which those are
        """
        height, width = self.upright.shape
        places = (uv + 0.5) * self.scale - 0.5 + MARGIN_PX
        end = np.array((width, height)) - MARGIN_PX - 0.5
        inside = ((places > MARGIN_PX - 0.5) & (places < end)).all(axis=1)
        u, v = np.rint(places[inside]).astype(np.int64).T
        return np.asarray(v * width + u), np.asarray(inside)


def find_edges(color: NDArray[np.uint8], camera: CameraModel) -> Edges:
    """Measure the edges of a colour image, (H, W, 3) uint8 RGB."""
    scale = min(1.0, _WIDTH_PX / camera.width)
    if scale < 1:
        color = np.asarray(cv2.resize(color, None, fx=scale, fy=scale,
                                      interpolation=cv2.INTER_AREA), np.uint8)
    smooth = cv2.GaussianBlur(color, (0, 0), _SMOOTHING_PX)
    maps, clear = [], np.zeros(color.shape[:2], np.bool_)
    for across in ((1, 0), (0, 1)):
        red, green, blue = cv2.split(np.abs(cv2.Sobel(smooth, cv2.CV_16S, *across, ksize=3)))
        strength = cv2.max(red, cv2.max(green, blue)).astype(np.float32) / 8
        clear |= strength > _CLEAR
        usual = cv2.blur(strength, (_AROUND_PX, _AROUND_PX)) + _NOISE
        share = cv2.dilate(strength / (strength + 2 * usual),
                           np.ones((_REACH_PX, _REACH_PX), np.uint8))
        maps.append(cv2.copyMakeBorder(share, *(MARGIN_PX,) * 4, cv2.BORDER_CONSTANT,
                                       value=np.nan).astype(np.float32))
    return Edges(maps[0], maps[1], scale, np.count_nonzero(clear) / clear.size)
