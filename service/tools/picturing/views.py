"""A face in the colours of values: views of its points, and what the colours mean."""

from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

__all__ = ["SCALE_STEPS", "Mark", "diverging", "encode_png", "legend", "nice_limit", "sequential",
           "view"]

_BACKGROUND, _UNKNOWN = (255, 255, 255), (186, 188, 190)
"""RGB, of the paper and of points without a value."""
_INK = (24, 26, 28)
_COLD, _MIDDLE, _WARM = (33, 84, 176), (240, 240, 236), (186, 30, 38)
"""RGB at the ends and the middle of a diverging scale: told apart by the colour-blind, too."""
_AMBIENT = 0.45
"""Share of a point's colour that shading leaves where it faces away from the lamp."""
_LAMP = np.array([-0.35, -0.45, -0.82])
_OVERSAMPLING = 2
_FILL = 0.94
"""Share of a picture's width or height that a face takes."""
SCALE_STEPS = (0.25, 0.5, 1.0, 2.0, 5.0, 10.0)
"""Ends that a scale may have, mm."""
_FONT = cv2.FONT_HERSHEY_SIMPLEX


class Mark(NamedTuple):
    """A ring around a place, with a number."""

    point: NDArray[np.float64]
    """(3,) mm, in the frame of the points."""
    radius_mm: float
    text: str


def nice_limit(largest_mm: float) -> float:
    """Give the smallest of `SCALE_STEPS` that holds a value."""
    return next((step for step in SCALE_STEPS if step >= largest_mm), SCALE_STEPS[-1])


def diverging(values: NDArray[np.float64], limit: float) -> NDArray[np.uint8]:
    """Give colours, (n, 3) RGB: blue at -limit, red at limit, grey where not known."""
    share = np.clip(np.nan_to_num(values) / limit, -1, 1)[:, None]
    ends = np.where(share < 0, _COLD, _WARM)
    # Its root: small values are seen, too.
    strength = np.abs(share) ** 0.8
    return _known(np.array(_MIDDLE) * (1 - strength) + ends * strength, values)


def sequential(values: NDArray[np.float64], limit: float) -> NDArray[np.uint8]:
    """Give colours, (n, 3) RGB, from dark to bright between 0 and a limit; grey where not known."""
    level = np.rint(np.clip(np.nan_to_num(values) / limit, 0, 1) * 255).astype(np.uint8)
    colors = cv2.applyColorMap(level[:, None], cv2.COLORMAP_VIRIDIS)[:, 0, ::-1]
    return _known(colors.astype(np.float64), values)


def _known(colors: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.uint8]:
    out = np.where(np.isfinite(values)[:, None], colors, _UNKNOWN)
    return np.asarray(np.rint(out), np.uint8)


def _shaded(
    normals: NDArray[np.float64], colors: NDArray[np.uint8]
) -> NDArray[np.uint8]:
    """Shade colours, (n, 3), by a lamp from the upper left."""
    lamp = _LAMP / np.linalg.norm(_LAMP)
    light = _AMBIENT + (1 - _AMBIENT) * np.clip(normals @ lamp, 0, 1)
    return np.asarray(np.rint(colors * np.minimum(light * 1.08, 1)[:, None]), np.uint8)


def view(
    points: NDArray[np.float64], normals: NDArray[np.float64], colors: NDArray[np.uint8], *,
    turn_deg: float, size: tuple[int, int], step_mm: float, marks: Sequence[Mark] = (),
) -> NDArray[np.uint8]:
    """Draw points that look toward -z, y down, turned about the vertical.

    Parameters
    ----------
    points, normals, colors : (n, 3) each, mm and RGB
    size : width and height, pixels
    step_mm : distance of neighbouring points: each is drawn so wide that no gap is seen

    Returns
    -------
    (height, width, 3) uint8, RGB
    """
    c, s = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    turn = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    at, facing = (points - middle) @ turn.T, normals @ turn.T
    width, height = (side * _OVERSAMPLING for side in size)
    reach = np.abs(points - middle)
    half = max(float(np.hypot(reach[:, 0], 0.5 * reach[:, 2]).max()), 1.0)
    scale = _FILL * min(width / 2 / half, height / 2 / max(float(reach[:, 1].max()), 1.0))
    shaded = _shaded(facing, colors)
    front = np.flatnonzero(facing[:, 2] < 0.05)
    order = front[np.argsort(-at[front, 2])]
    u = np.floor(at[order, 0] * scale + width / 2).astype(np.intp)
    v = np.floor(at[order, 1] * scale + height / 2).astype(np.intp)
    side = max(2, int(np.ceil(1.5 * step_mm * scale)))
    rank = np.full((height, width), -1.0)
    inside = np.flatnonzero((u >= 0) & (u < width) & (v >= 0) & (v < height))
    rank[v[inside], u[inside]] = inside
    rank = np.asarray(cv2.dilate(rank, np.ones((side, side), np.uint8)))
    image = np.full((height, width, 3), _BACKGROUND, np.uint8)
    drawn = rank >= 0
    image[drawn] = shaded[order[rank[drawn].astype(np.intp)]]
    for mark in marks:
        place = (mark.point - middle) @ turn.T * scale
        x, y = round(place[0] + width / 2), round(place[1] + height / 2)
        radius = max(round(mark.radius_mm * scale), 12)
        cv2.circle(image, (x, y), radius, _INK, 3, cv2.LINE_AA)
        for color, thick in ((_BACKGROUND, 9), (_INK, 3)):
            cv2.putText(image, mark.text, (x + radius + 6, y + 12), _FONT, 1.3, color, thick,
                        cv2.LINE_AA)
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)


def legend(
    limit: float, width: int, words: tuple[str, str, str], *, both: bool = True
) -> NDArray[np.uint8]:
    """Draw a scale of colours with words at its ends and its middle: (44, width, 3) RGB."""
    values = np.linspace(-limit if both else 0, limit, width - 40)
    bar = (diverging if both else sequential)(values, limit)
    image = np.full((44, width, 3), _BACKGROUND, np.uint8)
    image[4:18, 20:width - 20] = bar
    for share, text in zip((0.0, 0.5, 1.0), words, strict=True):
        (wide, _), _ = cv2.getTextSize(text, _FONT, 0.45, 1)
        left = round(20 + share * (width - 40) - share * wide)
        cv2.putText(image, text, (left, 37), _FONT, 0.45, _INK, 1, cv2.LINE_AA)
    return image


def encode_png(image: NDArray[np.uint8]) -> bytes:
    """Give an (H, W, 3) RGB picture as a PNG file."""
    encoded, data = cv2.imencode(".png", cv2.cvtColor(image, cv2.COLOR_RGB2BGR))
    if not encoded:
        raise RuntimeError("OpenCV could not write the PNG")
    return data.tobytes()
