"""The frame file: one `RgbdFrame` in a `.npz`, without pickles."""

import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import MAX_SIDE, Calibration, ChosenCalibration
from denseface.capture.errors import FrameError
from denseface.capture.frame import RgbdFrame
from denseface.capture.source import Source
from denseface.capture.zipped_arrays import ArrayKind, read_arrays
from denseface.files import replacing

__all__ = ["NpzSource", "load_frame", "save_frame"]

_KINDS = {
    "depth": ArrayKind("uint16", ("H", "W"), MAX_SIDE),
    "color": ArrayKind("uint8", ("H", "W", 3), MAX_SIDE),
    "depth_timestamp_us": ArrayKind("int64"),
    "color_timestamp_us": ArrayKind("int64"),
    "calibration": ArrayKind("str"),
    "registered": ArrayKind("bool"),
}


class NpzSource(Source):
    """The one frame of a `.npz` file as a source."""

    frame_count = 1

    def __init__(self, path: Path, chosen: ChosenCalibration | None = None) -> None:
        self.uri = str(path)
        self._frame = load_frame(path, chosen)

    def __iter__(self) -> Iterator[RgbdFrame]:
        yield self._frame

    def close(self) -> None:
        """Nothing is held open."""


def load_frame(path: str | Path, chosen: ChosenCalibration | None = None) -> RgbdFrame:
    """Read a frame file.

    Parameters
    ----------
    chosen : a calibration that wins over the file's own

    Raises
    ------
    UnreadableSourceError
        Missing, truncated, or not a zip archive of NumPy arrays.
    FrameError
        A key is missing, unknown, or has not the dtype and shape of the format.
    CalibrationError
        The file's own calibration is used and is not one.
    """
    optional = ("registered",) if chosen is None else ("registered", "calibration")
    arrays = read_arrays(path, _KINDS, optional)
    calibration, origin = chosen or (_own_calibration(path, arrays["calibration"]), "npz file")
    try:
        return RgbdFrame(
            arrays["depth"], arrays["color"],
            int(arrays["depth_timestamp_us"]), int(arrays["color_timestamp_us"]),
            calibration, bool(arrays.get("registered", False)), calibration_origin=origin,
        )
    except FrameError as error:
        raise FrameError(f"{path}: {error} (calibration: {origin})") from error


def save_frame(path: str | Path, frame: RgbdFrame) -> None:
    """Write a frame file: whole, or not at all; OSError as from the system."""
    with replacing(Path(path)) as file:
        np.savez_compressed(
            file, allow_pickle=False, depth=frame.depth, color=frame.color,
            depth_timestamp_us=np.int64(frame.depth_timestamp_us),
            color_timestamp_us=np.int64(frame.color_timestamp_us),
            calibration=np.array(frame.calibration.to_json()),
            registered=np.bool_(frame.registered),
        )
        file.flush()
        os.fsync(file.fileno())


def _own_calibration(path: str | Path, array: NDArray[Any]) -> Calibration:
    try:
        text = str(array)
    except (ValueError, SystemError) as error:
        raise FrameError(f"{path}: calibration: not Unicode text") from error
    return Calibration.from_json(text, name=f"{path}: calibration")
