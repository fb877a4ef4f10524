"""How sharp a face is, and how much of it is too dark or burnt."""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bytes, Floats
from denseface.recon.face import Box

__all__ = ["Light", "light", "sharpness"]

_SEMI_AXES = (0.33, 0.40)
"""Of the ellipse from brows to chin, by the width of the box: neither hair nor what is behind."""
_DARK = 40
"""A pixel whose brightest channel is below this, of 255, is dark: two thirds of it is noise when
it is made as bright as a face."""
_BURNT = 250
"""A pixel of which a channel is above this is burnt."""
_SIDE = 64
"""The ellipse's pixels are looked at in a square of this side."""
_BLUR_PX = 1.2
"""Standard deviation of the Gaussian before the gradient: the camera's noise is not sharpness."""
_Y, _X = np.mgrid[:_SIDE, :_SIDE]
_MIDDLE = (_SIDE - 1) / 2
_INSIDE = (((_X - _MIDDLE) / (_SEMI_AXES[0] * _SIDE))**2
           + ((_Y - _MIDDLE) / (_SEMI_AXES[1] * _SIDE))**2) < 1


class Light(NamedTuple):
    """Shares of the face, 0 to 1."""

    dark: float
    burnt: float


def light(color: Bytes, box: Box) -> Light | None:
    """Look at the light on a face; None where its box is outside the image.

    color : (H, W, 3) uint8, RGB
    """
    x, y, w, h = box
    height, width = color.shape[:2]
    columns = np.rint(x + (np.arange(_SIDE) + 0.5) * w / _SIDE - 0.5).astype(int)
    rows = np.rint(y + (np.arange(_SIDE) + 0.5) * h / _SIDE - 0.5).astype(int)
    inside = (_INSIDE & ((rows >= 0) & (rows < height))[:, None]
              & ((columns >= 0) & (columns < width)))
    if not inside.any():
        return None
    columns, rows = np.clip(columns, 0, width - 1), np.clip(rows, 0, height - 1)
    brightest = color[rows[:, None], columns].max(axis=2)[inside]
    return Light(float((brightest < _DARK).mean()), float((brightest > _BURNT).mean()))


def sharpness(image: Floats) -> float:
    """Give the mean square of the gradient of a face, by that of its mean brightness.

    Tenengrad (Krotkov, 1988), after a Gaussian, and free of how bright the light is.

    image : (96, 96) float32, brightness of its box
    """
    smooth = cv2.GaussianBlur(image, (0, 0), _BLUR_PX)
    dx, dy = cv2.Sobel(smooth, cv2.CV_32F, 1, 0), cv2.Sobel(smooth, cv2.CV_32F, 0, 1)
    return float((dx * dx + dy * dy).mean()) / max(float(image.mean()) ** 2, 1.0)
