"""A frame made of two image files: depth, and colour where there is one."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, ChosenCalibration
from denseface.capture.doubts import doubts_of
from denseface.capture.errors import CalibrationError, FrameError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
from denseface.capture.image_pair._defaults import default_calibration
from denseface.capture.image_pair._files import MAX_PIXELS, read_color_image, read_depth_image
from denseface.capture.image_pair._units import counts_of, guess_unit
from denseface.capture.source import Source

__all__ = ["NOTHING_SAID", "ImagePair", "ImagePairSource", "PairReading", "PairSource", "read_pair"]

_GUESS = "the depth is taken to be"
"""Begins the note that is dropped where agreement was measured."""


class ImagePair(NamedTuple):
    """The files of one frame."""

    depth: Path
    color: Path | None
    depth_us: int = 0
    color_us: int = 0
    """When each was taken, microseconds of one clock."""
    captured_at: str = ""
    """ISO 8601, UTC; empty where the files do not say."""


class PairReading(NamedTuple):
    """How pairs are to be understood; None is measured or guessed, and said in a note."""

    unit_mm: float | None = None
    """What 1 stands for in a depth image."""
    registered: bool | None = None
    """Whether the depth is in the colour camera's pixels already."""
    chosen: ChosenCalibration | None = None
    rounding: DepthRounding = DepthRounding.ROUND
    max_pixels: int = MAX_PIXELS
    """Of each image."""
    notes: tuple[str, ...] = ()
    """What else is to be said of each frame."""


NOTHING_SAID = PairReading()


class PairSource(Source):
    """A source whose frames are made by `read_pair`."""

    def settled(self, frame: RgbdFrame) -> RgbdFrame:
        """Give a frame as `prepared` does, without the guess that was measured and found right."""
        frame = self.prepared(frame)
        if self._preparation is None or not self._preparation.agrees:
            return frame
        notes = tuple(note for note in frame.origin.notes if not note.startswith(_GUESS))
        return replace(frame, origin=replace(frame.origin, notes=notes))


class ImagePairSource(PairSource):
    """The one frame that two image files make."""

    frame_count = 1

    def __init__(
        self, depth: str | Path, color: str | Path | None = None,
        reading: PairReading = NOTHING_SAID,
    ) -> None:
        self.uri = str(depth)
        self._frame = read_pair(ImagePair(Path(depth), Path(color) if color else None), reading)

    def __iter__(self) -> Iterator[RgbdFrame]:
        yield self.settled(self._frame)

    def close(self) -> None:
        """Nothing is held open."""


def read_pair(pair: ImagePair, reading: PairReading) -> RgbdFrame:
    """Read both files and make a frame of them.

    Raises
    ------
    UnreadableSourceError, FrameError
        As from `read_depth_image` and `read_color_image`; the unit is not clear from the values;
        no pixel has a reading.
    CalibrationError
        The chosen calibration is for images of other shapes.
    """
    values = read_depth_image(pair.depth, reading.max_pixels)
    color = read_color_image(pair.color, reading.max_pixels) if pair.color else None
    notes = list(reading.notes)
    unit_mm = reading.unit_mm
    if unit_mm is None:
        try:
            unit_mm = guess_unit(values)
        except FrameError as error:
            raise FrameError(f"{pair.depth}: {error}") from error
        notes.append(f"the depth image does not say its unit: 1 is taken for {_length(unit_mm)}")
    depth, unit_um = counts_of(values, unit_mm)
    source = " + ".join(path.name for path in (pair.depth, pair.color) if path)
    cameras = _cameras(pair, _size(depth), None if color is None else _size(color), reading)
    return RgbdFrame(
        depth, color, pair.depth_us, pair.color_us, cameras.calibration, cameras.registered,
        calibration_origin=cameras.origin,
        depth_meaning=DepthMeaning(unit_um=unit_um, rounding=reading.rounding),
        origin=FrameOrigin(captured_at=pair.captured_at, notes=(*notes, *cameras.notes),
                           source=source))


class _Cameras(NamedTuple):
    calibration: Calibration
    registered: bool
    origin: str
    notes: tuple[str, ...]


def _cameras(
    pair: ImagePair, depth: tuple[int, int], color: tuple[int, int] | None, reading: PairReading
) -> _Cameras:
    """Fit the chosen or a default calibration to images of these sizes."""
    registered, notes = _is_registered(depth, color, reading)
    if reading.chosen is None:
        default = default_calibration(depth, color, registered)
        calibration, origin = default.calibration, "default"
        notes += (f"no calibration was given: {default.words}",)
    else:
        calibration, origin, assumed, _ = reading.chosen
        notes += assumed
        if not registered and color and calibration.depth == calibration.color and (
                "depth_to_color" not in calibration.model_fields_set):
            raise CalibrationError(
                f"{origin}: describes one camera, but the depth ({_by(depth)}) is not registered "
                f"to the colour ({_by(color)}); expected both cameras and their pose, or "
                "--registered yes")
        notes += doubts_of(calibration, registered or color is None)
    try:
        fitted, registered = calibration.for_images(depth, color, registered)
    except CalibrationError as error:
        raise CalibrationError(f"{pair.depth}: {error} (calibration: {origin})") from error
    return _Cameras(fitted, registered, origin, notes)


def _is_registered(
    depth: tuple[int, int], color: tuple[int, int] | None, reading: PairReading
) -> tuple[bool, tuple[str, ...]]:
    if color is None:
        return False, ()
    if reading.registered is not None:
        return reading.registered, ()
    if reading.chosen and reading.chosen.registered is not None:
        return reading.chosen.registered, ()
    calibration = reading.chosen and reading.chosen.calibration
    two = calibration and (calibration.depth != calibration.color
                           and "depth_to_color" in calibration.model_fields_set)
    registered = depth == color and not two
    why = ("it has the colour image's size" if registered else
           "the calibration has two cameras and a pose" if two else
           f"it is {_by(depth)}, the colour image {_by(color)}")
    return registered, (f"{_GUESS} {'' if registered else 'not '}registered to the colour: {why} "
                        "(--registered says)",)


def _size(image: NDArray[np.uint8] | NDArray[np.uint16]) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def _by(size: tuple[int, int]) -> str:
    return f"{size[0]}x{size[1]}"


def _length(mm: float) -> str:
    return "1 m" if mm == 1000 else f"{mm:g} mm"
