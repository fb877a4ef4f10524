"""What a recording's file says of its frames, without their images."""

from dataclasses import replace
from datetime import datetime, timedelta
from functools import cached_property
from pathlib import Path

from denseface.capture.calibration import MAX_SIDE, ChosenCalibration
from denseface.capture.errors import UnreadableSourceError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin
from denseface.capture.oni.description import Description
from denseface.capture.oni.file import OniNode, read_oni
from denseface.capture.oni.mend import what_is_missing
from denseface.capture.oni.order import color_lag_us
from denseface.capture.oni.records import DEPTH_NODE, DESCRIPTION, IMAGE_NODE
from denseface.capture.pairing import Pairer

__all__ = ["Recorded"]

_MAX_NAME = 64
"""Characters of a sensor's name."""


class Recorded:
    """A recording's frames: how many, how they belong together, what their numbers mean.

    Raises
    ------
    UnreadableSourceError
        As `read_oni`; there is no depth stream, or a stream has no size.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.file = read_oni(path)
        depth = self._stream(DEPTH_NODE, "depth")
        if depth is None:
            raise UnreadableSourceError(f"{path}: has no depth stream; depth is needed")
        self.depth, self.color = depth, self._stream(IMAGE_NODE, "color")
        text = depth.texts.get(DESCRIPTION)
        self._described = None if text is None else Description.read(str(path), text)
        lag_us = 0 if self._described else color_lag_us(self.file.order, self.file.stamps_us)
        self.shift_us = {DEPTH_NODE: max(-lag_us, 0), IMAGE_NODE: max(lag_us, 0)}
        """What is to be added to the stamps of a stream, microseconds."""

    def _stream(self, kind: int, name: str) -> OniNode | None:
        """Find a stream that has a size: without one, OpenNI2 invents it and crashes."""
        node = self.file.node(kind)
        if node is None:
            return None
        if node.sides is None or not all(1 <= side <= MAX_SIDE for side in node.sides):
            found = "no size" if node.sides is None else "{}x{}".format(*node.sides)
            raise UnreadableSourceError(
                f"{self.path}: the {name} stream has {found}, expected sides of 1 to {MAX_SIDE}")
        return node

    @cached_property
    def pairs(self) -> int:
        """How many pairs of depth and colour there are; without colour, how many depths."""
        if self.color is None:
            return self.depth.frames
        if self.in_pairs:
            return min(self.depth.frames, self.color.frames)
        pairer: Pairer[None, None] = Pairer()
        return sum(
            (pairer.add_depth if kind == DEPTH_NODE else pairer.add_color)(
                stamp + self.shift_us[kind], None) is not None
            for kind, stamp in zip(self.file.order, self.file.stamps_us, strict=True))

    @property
    def in_pairs(self) -> bool:
        """Whether depth and colour of a number belong together, whatever their stamps.

        So writes `OniWriter`: who took the frames knew more of their clocks than their stamps say.
        """
        return self._described is not None

    @property
    def calibration(self) -> ChosenCalibration | None:
        """The one under which it was recorded, where it says so."""
        if self._described is None:
            return None
        return ChosenCalibration(
            self._described.calibration, f"recording: {self._described.calibration_origin}")

    def meaning(self, known: DepthMeaning) -> DepthMeaning:
        """Say what depths mean whose unit and farthest reading OpenNI2 knows.

        PrimeSense's drivers, and the recordings made through them, cut the fraction off.
        """
        rounding = self._described.depth_rounding if self._described else DepthRounding.CUT
        return replace(known, rounding=rounding)

    def origin(self, depth_us: int, number: int) -> FrameOrigin:
        """Give the origin of a frame by its depth's stamp, shifted, and its number, from 0."""
        captured_at = self._described.captured_at if self._described else ""
        if captured_at:
            first = self._first_us[DEPTH_NODE] + self.shift_us[DEPTH_NODE]
            after = timedelta(microseconds=depth_us - first)
            captured_at = (datetime.fromisoformat(captured_at) + after).isoformat(
                timespec="milliseconds")
        return FrameOrigin(self._sensor, captured_at, skew_known_by=self._skew_known_by,
                           notes=self.notes, source=f"{self.path.name}#{number}")

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What was doubtful about the file, and what was done about it."""
        notes = []
        if self.file.cut:
            notes.append(f"the recording {self.file.cut}; the {self.pairs} whole frames before "
                         "that are used")
        elif missing := what_is_missing(self.file):
            notes.append(f"the recording lacks {missing}; a mended copy is played")
        if lag_us := self.shift_us[IMAGE_NODE] - self.shift_us[DEPTH_NODE]:
            late, other = ("color", "depth") if lag_us > 0 else ("depth", "color")
            notes.append(
                f"the recording's {late} stream began {abs(lag_us) / 1e3:.0f} ms after its {other} "
                "stream, but the time stamps of both start together: depth and color are paired by "
                "the order of records, known to one frame")
        return tuple(notes)

    @cached_property
    def _first_us(self) -> dict[int, int]:
        """The first stamp of each stream."""
        return dict(reversed(list(zip(self.file.order, self.file.stamps_us, strict=True))))

    @property
    def _skew_known_by(self) -> str:
        if self.color is None:
            return ""
        # OpenNI2's recorder lets both start at 0, whatever they were.
        zeroed = not self._described and not any(self._first_us.values())
        return "record order" if zeroed or any(self.shift_us.values()) else "stamps"

    @cached_property
    def _sensor(self) -> str:
        if self._described:
            return self._described.sensor
        names = (node.texts.get(name) for name in ("oniOriginalDevice", "DeviceName")
                 for node in self.file.nodes.values())
        text = next(filter(None, names), b"").split(b"\0")[0].decode("ascii", "replace")
        return text[:_MAX_NAME] if text.isprintable() else ""
