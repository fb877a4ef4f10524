"""A synchronized depth + colour frame, what its numbers mean and where it comes from."""

import math
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import StrEnum
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from denseface.arguments import describe
from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.errors import FrameError
from denseface.html_repr import PICTURE_SIDE, html_repr
from denseface.short_repr import short_repr

__all__ = ["MAX_BURST", "DepthMeaning", "DepthRounding", "FrameOrigin", "RgbdFrame"]

_MOST = 2**63
"""Of a number in a file or message."""
_UNITS_UM = (1, 100_000)
"""Least and most micrometres of one count of a depth."""
MAX_BURST = 32
"""Frames that one frame is made of, at most: a second of a sensor, in which few hold still."""


def _check_number(name: str, given: object) -> None:
    if isinstance(given, bool) or not isinstance(given, int | np.integer):
        raise FrameError(f"{name} must be a whole number, found {describe(given)}")
    if not -_MOST <= given < _MOST:
        raise FrameError(f"{name} must fit into 64 bits, found {given}")


class DepthRounding(StrEnum):
    """How a measured depth became a whole number of units."""

    CUT = "cut"
    """The fraction was cut off, as PrimeSense's drivers do: half a unit is missing on average."""
    ROUND = "round"
    """To the nearest."""
    NONE = "none"
    """Not at all: the unit is far below the sensor's resolution, or the depth is an average."""


@dataclass(frozen=True)
class DepthMeaning:
    """What the numbers of a depth image mean.

    Attributes
    ----------
    unit_um : micrometres of one count
    rounding : how a depth became a whole number of counts
    max_mm : the farthest reading; a larger number is none. None where any may be one.

    Raises
    ------
    FrameError
        Where a value is out of its range.
    """

    unit_um: int = 1000
    rounding: DepthRounding = DepthRounding.ROUND
    max_mm: int | None = None

    def __post_init__(self) -> None:
        _check_number("depth_unit_um", self.unit_um)
        if self.max_mm is not None:
            _check_number("max_mm", self.max_mm)
        if self.rounding not in set(DepthRounding):
            raise FrameError(f"depth_rounding must be {', '.join(DepthRounding)}, found "
                             f"{describe(self.rounding)}")
        object.__setattr__(self, "rounding", DepthRounding(self.rounding))  # of a text
        least, most = _UNITS_UM
        if not least <= self.unit_um <= most:
            raise FrameError(f"depth_unit_um must be {least} to {most}, found {self.unit_um}")
        if self.max_mm is not None and self.max_mm < 1:
            raise FrameError(f"max_mm must be positive, found {self.max_mm}")

    @property
    def offset_mm(self) -> float:
        """What is missing of each depth on average, mm."""
        return self.unit_um / 2000 if self.rounding is DepthRounding.CUT else 0.0

    @property
    def max_count(self) -> int:
        """The largest number that is a reading."""
        return 65535 if self.max_mm is None else min(self.max_mm * 1000 // self.unit_um, 65535)


@dataclass(frozen=True)
class FrameOrigin:
    """Where a frame comes from, and how that is known.

    Attributes
    ----------
    sensor : its identity: serial number, USB port or URI; empty where not known
    captured_at : ISO 8601, UTC; empty where not known
    exposed_after_press_ms : from the press's arrival to the estimated exposure of the earlier of
        both images; None where there was no press, or the source is no live one
    exposure_known_by : what that estimate rests on; `stamps` of the sensor, `arrival` at the host
    skew_known_by : what the skew rests on: `stamps`, `arrival` or `record order`
    fused : of how many frames the depth is the average
    notes : doubts and corrections, in plain English; they become warnings of the report
    source : what it was read from, without the folders of this machine: `NAME.oni#0` (file or
        folder, and number of the frame), `openni2:SERIAL`; empty where not known
    """

    sensor: str = ""
    captured_at: str = ""
    exposed_after_press_ms: float | None = None
    exposure_known_by: str = ""
    skew_known_by: str = ""
    fused: int = 1
    notes: tuple[str, ...] = ()
    source: str = ""

    def __post_init__(self) -> None:
        for name in ("sensor", "captured_at", "source"):
            if not isinstance(text := getattr(self, name), str):
                hint = ": its isoformat()" if isinstance(text, datetime) else ""
                raise FrameError(f"{name} must be str, found {describe(text)}{hint}")
        _check_number("fused", self.fused)
        if not 1 <= self.fused <= MAX_BURST:
            raise FrameError(f"fused must be 1 to {MAX_BURST}, found {self.fused}")
        if not self.source.isprintable():  # the name of a file may be any bytes
            line = "".join(one if one.isprintable() else "?" for one in self.source)
            object.__setattr__(self, "source", line)


@dataclass(frozen=True, eq=False, repr=False)
class RgbdFrame:
    """One synchronized depth + colour pair with its calibration; never mirrored.

    Attributes
    ----------
    depth : (H, W) uint16, counts of `depth_meaning.unit_um` along z (millimetres unless it says
        otherwise), 0 = no reading, as the depth camera sees it (in the colour camera's pixels
        where `registered`)
    color : (H', W', 3) uint8, RGB; None where the sensor has no colour camera
    depth_timestamp_us, color_timestamp_us : sensor clock, microseconds; the same without colour
    calibration : both cameras and their relative pose
    registered : depth is already in the colour camera's pixels
    calibration_origin : which calibration this is, for the report
    depth_meaning : what the depth's numbers mean
    origin : where the frame comes from

    Raises
    ------
    FrameError
        Where an array's shape or dtype is not as above or not as the calibration states.
    """

    depth: NDArray[np.uint16]
    color: NDArray[np.uint8] | None
    depth_timestamp_us: int
    color_timestamp_us: int
    calibration: Calibration
    registered: bool = False
    calibration_origin: str = field(default="unspecified", kw_only=True)
    depth_meaning: DepthMeaning = field(default=DepthMeaning(), kw_only=True)
    origin: FrameOrigin = field(default=FrameOrigin(), kw_only=True)

    def __post_init__(self) -> None:
        _check_depth(self.depth)
        for name, kind in _KINDS.items():
            if not isinstance(given := getattr(self, name), kind):
                raise FrameError(f"{name} must be {kind.__name__}, found {describe(given)}")
        if not isinstance(self.registered, bool | np.bool_):
            raise FrameError(f"registered must be bool, found {describe(self.registered)}")
        for name in ("depth_timestamp_us", "color_timestamp_us"):
            _check_number(name, getattr(self, name))
        images: list[tuple[str, NDArray[Any], CameraModel]] = [
            ("depth", self.depth, self.depth_camera)]
        if self.color is not None:
            _check_color(self.color)
            images.append(("color", self.color, self.calibration.color))
        elif self.registered:
            raise FrameError("registered, but there is no color to be registered to")
        for name, image, camera in images:
            height, width = image.shape[:2]
            if (width, height) != (camera.width, camera.height):
                raise FrameError(f"{name} is {width}x{height}, its calibration says "
                                 f"{camera.width}x{camera.height}")

    def __repr__(self) -> str:
        depth, color = ("no color" if image is None else f"{name} {image.shape[1]}x{image.shape[0]}"
                        for name, image in (("depth", self.depth), ("color", self.color)))
        readings = np.count_nonzero(self.depth) / self.depth.size
        return short_repr(
            self, depth, f"{readings:.0%} of it measured", color,
            "registered" if self.registered else "",
            self.origin.sensor or self.origin.source, self.origin.captured_at)

    def _repr_html_(self) -> str:
        meaning, origin = self.depth_meaning, self.origin
        depths = self.depth[self.depth > 0] * (meaning.unit_um / 1000)
        near, far = np.percentile(depths, [5, 95]) if depths.size else (0.0, 0.0)
        rows = [
            ("depth", "{1} x {0}".format(*self.depth.shape)),
            ("of it measured", f"{depths.size / self.depth.size:.0%}"),
            ("most within", f"{near:.0f} to {far:.0f} mm" if depths.size else ""),
            ("color", "none" if self.color is None else "{1} x {0}".format(*self.color.shape)),
            ("registered", "yes" if self.registered else "no"), ("skew", f"{self.skew_us} us"),
            ("calibration", self.calibration_origin), ("sensor", origin.sensor),
            ("source", origin.source), ("captured", origin.captured_at),
            *(("note", note) for note in origin.notes)]
        pictures = [("depth", _depth_picture(self.depth))]
        if self.color is not None:
            pictures.append(("color", _smaller(self.color)))
        return html_repr("RgbdFrame", rows, pictures)

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """`color`, where there is one.

        Raises
        ------
        FrameError
            The sensor has no colour camera.
        """
        if self.color is None:
            raise FrameError("the frame has no color")
        return self.color

    @property
    def depth_camera(self) -> CameraModel:
        """The camera in whose pixels `depth` is given."""
        return self.calibration.color if self.registered else self.calibration.depth

    @property
    def depth_to_color(self) -> DepthToColor:
        """From the frame of `depth_camera` to the colour camera's: identity where registered."""
        return DepthToColor() if self.registered else self.calibration.depth_to_color

    @property
    def skew_us(self) -> int:
        """How much later the depth was taken than the colour, microseconds."""
        return self.depth_timestamp_us - self.color_timestamp_us

    def with_calibration(self, calibration: Calibration, origin: str) -> Self:
        """Give the same images under another calibration."""
        return replace(self, calibration=calibration, calibration_origin=origin)

    def with_source(self, source: str) -> Self:
        """Give the same frame under the name of what it was read from."""
        return replace(self, origin=replace(self.origin, source=source))

    def with_note(self, *notes: str) -> Self:
        """Give the same frame with more notes of its origin."""
        return replace(self, origin=replace(self.origin, notes=(*self.origin.notes, *notes)))


def _depth_picture(depth: NDArray[np.uint16]) -> NDArray[np.uint8]:
    """Draw a depth image small: near is light, what has no reading is transparent."""
    step = _step(depth)
    small = depth[::step, ::step].astype(np.float32)
    there = small > 0
    image = np.zeros((*small.shape, 4), np.uint8)
    if there.any():
        near, far = np.percentile(small[there], [2, 98])
        share = np.clip((far - small) / max(far - near, 1), 0, 1)
        image[..., :3] = (40 + 215 * share)[..., None]
        image[there, 3] = 255
    return image


def _smaller(color: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Average a colour image over squares, so that it is as small as a depth's picture."""
    step = _step(color)
    height, width = (color.shape[0] // step, color.shape[1] // step)
    squares = color[:height * step, :width * step].reshape(height, step, width, step, 3)
    small: NDArray[np.uint8] = squares.mean(axis=(1, 3), dtype=np.float32).astype(np.uint8)
    return small


def _step(image: NDArray[Any]) -> int:
    side: int = max(image.shape[:2])
    return math.ceil(side / PICTURE_SIDE)


_KINDS: dict[str, type] = {
    "calibration": Calibration, "depth_meaning": DepthMeaning, "origin": FrameOrigin,
    "calibration_origin": str}
"""What `RgbdFrame` takes beside its arrays and numbers."""
_NO_ARRAY = "np.asarray makes one of what holds numbers"


def _check_depth(depth: object) -> None:
    if isinstance(depth, np.ndarray) and depth.dtype == np.uint16 and depth.ndim == 2:
        return
    hint = ""
    if not isinstance(depth, np.ndarray):
        hint = _NO_ARRAY if depth is not None else ""
    elif depth.ndim == 3 and depth.shape[2] == 1:
        hint = "depth[..., 0] is one"
    elif depth.ndim == 2 and depth.dtype.kind == "f":
        hint = "of metres (1000 * depth).round().astype(np.uint16) makes one"
    elif depth.ndim == 2 and depth.dtype.kind in "iu" and depth.dtype.itemsize > 1:
        hint = "of millimetres depth.astype(np.uint16) makes one"
    raise FrameError(_expected("depth", "(H, W) uint16 array", depth, hint))


def _check_color(color: object) -> None:
    is_array = isinstance(color, np.ndarray) and color.dtype == np.uint8
    shape: tuple[int, ...] = color.shape if isinstance(color, np.ndarray) else ()
    if is_array and shape[2:] == (3,):
        return
    hint = ""
    if not isinstance(color, np.ndarray):
        hint = _NO_ARRAY
    elif shape[2:] == (4,):
        hint = "color[..., :3] leaves out the fourth channel"
    elif len(shape) == 3 and shape[0] == 3:
        hint = "np.moveaxis(color, 0, -1) puts the channels last"
    elif len(shape) == 2:
        hint = "np.dstack([color] * 3) makes one of shades of grey"
    elif color.dtype.kind == "f":
        hint = "of 0 to 1 (255 * color).round().astype(np.uint8) makes one"
    raise FrameError(_expected("color", "(H, W, 3) uint8 array, RGB", color, hint))


def _expected(name: str, kind: str, given: object, hint: str) -> str:
    return f"{name} must be a {kind}, found {describe(given)}{': ' if hint else ''}{hint}"
