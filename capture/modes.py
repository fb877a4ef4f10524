"""Video modes: which pair of a depth and a colour mode to ask a sensor for, best first.

What a sensor offers is chosen from, not assumed: a Structure Sensor has 320x240 and no colour, an
Orbbec 640x400, an Xtion colour of 1280x1024 and YUV formats, some give 15 or 60 frames a second.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from denseface.capture.calibration import MAX_SIDE

__all__ = ["COLOR_FORMATS", "DEPTH_FORMATS", "Mode", "listed", "rank"]

DEPTH_FORMATS = ("DEPTH_1_MM", "DEPTH_100_UM")
"""Formats of depth that are read, the best first, by OpenNI2's names."""
COLOR_FORMATS = ("RGB888", "YUV422", "YUYV")
"""Formats of colour that are read, the best first: YUV has half the columns of colour."""
_BEST_FPS = 30
"""Frames a second: what these sensors are made for; more leaves the colour camera less light."""
_DEPTH_SIZES = ((640, 480), (640, 400), (320, 240))
"""Sizes of depth whose cut of the sensor is known, the best first."""
_COLOR_SIZES = ((640, 480), (1280, 960), (1280, 1024), (640, 400), (320, 240))
"""Sizes of colour whose cut of the sensor is known, the best first."""


@dataclass(frozen=True)
class Mode:
    """One way in which a stream can send its frames."""

    width: int
    """Pixels."""
    height: int
    """Pixels."""
    fps: int
    """Frames a second."""
    pixel_format: str
    """OpenNI2's name, as `RGB888`."""

    @property
    def size(self) -> tuple[int, int]:
        """Give (width, height), pixels."""
        return self.width, self.height

    def __str__(self) -> str:
        return f"{self.width}x{self.height} at {self.fps}/s as {self.pixel_format}"


def rank(depth: Iterable[Mode], color: Iterable[Mode] | None) -> list[tuple[Mode, Mode | None]]:
    """Give the pairs of modes that can be read, the best first.

    Both at one rate come first: of two rates, most frames of the faster have no partner. Then
    depth of 640x480 before other sizes, 30 frames a second before other rates, colour of 640x480
    before larger and smaller ones, RGB888 before YUV422 before YUYV, 1 mm before 100 um.

    Parameters
    ----------
    depth, color : what the two streams offer; None for a sensor without a colour camera

    Returns
    -------
    pairs of a depth and a colour mode, without colour where `color` is None; none where one of
    both offers nothing that can be read
    """
    depths = [mode for mode in dict.fromkeys(depth) if _readable(mode, DEPTH_FORMATS)]
    colors: list[Mode | None] = [None]
    if color is not None:
        colors = [mode for mode in dict.fromkeys(color) if _readable(mode, COLOR_FORMATS)]
    return sorted(((d, c) for d in depths for c in colors), key=_cost)


def listed(modes: Iterable[Mode]) -> str:
    """Name modes in one line, for a message: formats and rates of one size together."""
    sizes: dict[tuple[int, int, str], set[int]] = {}
    for mode in modes:
        sizes.setdefault((mode.width, mode.height, mode.pixel_format), set()).add(mode.fps)
    return "; ".join(f"{width}x{height} {pixel_format} at {'/'.join(map(str, sorted(rates)))}/s"
                     for (width, height, pixel_format), rates in sizes.items()) or "nothing"


def _readable(mode: Mode, formats: Sequence[str]) -> bool:
    # Two pixels of YUV share their colour.
    odd = mode.pixel_format in ("YUV422", "YUYV") and mode.width % 2
    return (mode.pixel_format in formats and 0 < mode.width <= MAX_SIDE
            and 0 < mode.height <= MAX_SIDE and mode.fps > 0 and not odd)


def _cost(pair: tuple[Mode, Mode | None]) -> tuple[float, ...]:
    """Order the pairs: the first number that differs decides."""
    depth, color = pair
    rate = abs(math.log(depth.fps / _BEST_FPS)), -depth.fps
    unit = DEPTH_FORMATS.index(depth.pixel_format)
    if color is None:
        return *_size_cost(depth.size, _DEPTH_SIZES), *rate, unit
    return (abs(depth.fps - color.fps), *_size_cost(depth.size, _DEPTH_SIZES), *rate,
            *_size_cost(color.size, _COLOR_SIZES), COLOR_FORMATS.index(color.pixel_format), unit)


def _size_cost(size: tuple[int, int], known: Sequence[tuple[int, int]]) -> tuple[float, ...]:
    """Put known sizes in their order, then others, the nearest in pixels to the best first."""
    if size in known:
        return known.index(size), 0.0, 0
    return len(known), abs(math.log(math.prod(size) / math.prod(known[0]))), -size[0]
