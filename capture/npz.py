"""The frame file: one `RgbdFrame` in a `.npz`, without pickles; and folders of such files."""

import errno
import io
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.arguments import as_path, expect
from denseface.capture.calibration import MAX_SIDE, Calibration, ChosenCalibration
from denseface.capture.calibration_files import choose_calibration
from denseface.capture.doubts import doubts_of
from denseface.capture.errors import CalibrationError, FrameError, UnreadableSourceError
from denseface.capture.frame import DepthMeaning, DepthRounding, FrameOrigin, RgbdFrame
from denseface.capture.source import Source
from denseface.capture.zipped_arrays import ArrayKind, read_arrays
from denseface.files import make_folder, sync, write_whole

__all__ = ["FolderSource", "FolderWriter", "NpzSource", "load_frame", "save_frame"]

_KINDS = {
    "depth": ArrayKind("uint16", ("H", "W"), MAX_SIDE),
    "color": ArrayKind("uint8", ("H", "W", 3), MAX_SIDE),
    "depth_timestamp_us": ArrayKind("int64"),
    "color_timestamp_us": ArrayKind("int64"),
    "calibration": ArrayKind("str"),
    "registered": ArrayKind("bool"),
    "depth_rounding": ArrayKind("str"),
    "depth_unit_um": ArrayKind("int64"),
    "depth_max_mm": ArrayKind("int64"),
    "sensor": ArrayKind("str"),
    "captured_at": ArrayKind("str"),
    "source": ArrayKind("str"),
}
_ENDING = ".npz"
_OTHERS = {"initial_points": "is a face that save_face wrote, not a frame: load_face reads it"}
"""Keys of other files of ours, and what they are."""
_COLOR = frozenset({"color", "color_timestamp_us"})
"""Keys that are absent, both, where the sensor has no colour camera."""
_OPTIONAL = frozenset(_KINDS) - {"depth", "depth_timestamp_us", "calibration"}
_MAX_LINE = 256
"""Characters of `sensor`, `captured_at` and `source`."""


class NpzSource(Source):
    """The one frame of a `.npz` file as a source."""

    frame_count = 1

    def __init__(self, path: Path, chosen: ChosenCalibration | None = None) -> None:
        self.uri = str(path)
        self._frame = _load(path, chosen)

    def __iter__(self) -> Iterator[RgbdFrame]:
        yield self.prepared(self._frame)

    def close(self) -> None:
        """Nothing is held open."""


class FolderSource(Source):
    """The frames of the `.npz` files in a folder, in the order of their names.

    Raises
    ------
    UnreadableSourceError
        There is none, or the folder cannot be read.
    """

    def __init__(self, folder: Path, chosen: ChosenCalibration | None = None) -> None:
        self.uri = str(folder)
        self._chosen = chosen
        self._paths = _frame_files(folder)
        if not self._paths:
            raise UnreadableSourceError(f"{folder}: is a folder without frame files (.npz)")
        self.frame_count = len(self._paths)

    def __iter__(self) -> Iterator[RgbdFrame]:
        return self.frames_from(0)

    def frames_from(self, number: int) -> Iterator[RgbdFrame]:
        """Read the frames from a number on, from 0, without those before it."""
        return (self.prepared(_load(path, self._chosen)) for path in self._paths[number:])

    def close(self) -> None:
        """Nothing is held open."""


class FolderWriter:
    """Writes frames into a folder as `000000.npz` and so on.

    The files are not compressed: that would take longer than a sensor's next frame.

    Parameters
    ----------
    mode : of the files, whatever the umask; a folder that is made is for this user alone

    Raises
    ------
    OSError
        As from the system; also where there are frame files already.
    """

    def __init__(self, folder: Path, mode: int = 0o600) -> None:
        self.path = folder
        self._mode = mode
        self.frames = 0
        """How many are in the folder."""
        self._unsynced: list[Path] = []
        self._made = not folder.exists()
        make_folder(folder.absolute(), 0o600)
        if _frame_files(folder):
            raise FileExistsError(errno.EEXIST, "Holds frame files already", str(folder))

    def add(self, frame: RgbdFrame) -> None:
        """Write one more; OSError as from the system."""
        path = self.path / f"{self.frames:06}.npz"
        save_frame(frame, path, quickly=True, mode=self._mode)
        self._unsynced.append(path)
        self.frames += 1

    def close(self) -> None:
        """See to it that all is on the disk; harmless when repeated.

        A folder that was made for no frame is removed.

        Raises
        ------
        OSError
            As from the system: a file may be lost that seemed to be written.
        """
        if self._made and not self.frames:
            with suppress(OSError):
                self.path.rmdir()
        while self._unsynced:
            sync(self._unsynced.pop())


def _frame_files(folder: Path) -> list[Path]:
    try:
        return sorted(path for path in folder.iterdir() if path.suffix.lower() == ".npz")
    except OSError as error:
        raise UnreadableSourceError(f"{folder}: {error.strerror or error}") from error


def load_frame(
    path: str | Path, calibration: Calibration | str | Path | None = None
) -> RgbdFrame:
    """Read a frame file, as `save_frame` writes it: the frame as it was taken.

    `open_source` also puts right a frame whose depth and colour do not belong together.

    Parameters
    ----------
    path : NAME.npz
    calibration : a calibration or the path of one, which wins over ``NAME.calibration.json`` beside
        the file, which wins over the file's own

    Raises
    ------
    UnreadableSourceError
        Missing, truncated, or not a zip archive of NumPy arrays; another kind of file.
    FrameError
        A key is missing, unknown, or has not the dtype and shape of the format.
    CalibrationError
        The calibration that is used cannot be read, or is not of these images.
    """
    path = as_path(path)
    if path.suffix.lower() != _ENDING:
        raise UnreadableSourceError(
            f"{path}: frames are read from {_ENDING} alone; open_source(path) reads recordings and "
            "folders")
    return _load(path, choose_calibration(path, calibration))


def _load(path: Path, chosen: ChosenCalibration | None) -> RgbdFrame:
    """Read a frame file; raises as `load_frame`."""
    optional = _OPTIONAL if chosen is None else _OPTIONAL | {"calibration"}
    arrays = read_arrays(path, _KINDS, optional, others=_OTHERS)
    if len(_COLOR & arrays.keys()) == 1:
        (missing,) = _COLOR - arrays.keys()
        raise FrameError(f"{path}: key {missing!r} is missing; color and color_timestamp_us: "
                         "expected both or neither")
    calibration, origin, notes, said = chosen or ChosenCalibration(
        _own_calibration(path, arrays["calibration"]), "npz file")
    depth, color = arrays["depth"], arrays.get("color")
    registered = bool(arrays.get("registered", False)) if said is None else said
    notes += doubts_of(calibration, registered or color is None)
    stamp = int(arrays["depth_timestamp_us"])
    try:
        # A file's own calibration is of its images; one that was chosen may be of others.
        if chosen or (registered and color is not None):
            calibration, registered = calibration.for_images(
                _size(depth), None if color is None else _size(color), registered)
        return RgbdFrame(
            depth, color, stamp, int(arrays.get("color_timestamp_us", stamp)),
            calibration, registered, calibration_origin=origin,
            depth_meaning=DepthMeaning(
                int(arrays.get("depth_unit_um", 1000)),
                _rounding(_text(path, arrays, "depth_rounding", DepthRounding.ROUND)),
                int(arrays["depth_max_mm"]) if "depth_max_mm" in arrays else None),
            origin=FrameOrigin(_text(path, arrays, "sensor"), _text(path, arrays, "captured_at"),
                               notes=notes,
                               source=_text(path, arrays, "source", Path(path).name)),
        )
    except (FrameError, CalibrationError) as error:
        raise type(error)(f"{path}: {error} (calibration: {origin})") from error


def _size(image: NDArray[Any]) -> tuple[int, int]:
    return image.shape[1], image.shape[0]


def save_frame(
    frame: RgbdFrame, path: str | Path, *, quickly: bool = False, mode: int | None = None
) -> None:
    """Write a frame file: whole, or not at all; folders that are missing are made.

    Parameters
    ----------
    path : NAME.npz
    quickly : do not compress, and do not wait for the disk
    mode : of the file, exactly; None for 666 less the umask

    Raises
    ------
    FrameError
        The path has another ending.
    OSError
        Where the file cannot be written: it names the file.
    """
    expect("frame", frame, RgbdFrame, "save_frame(frame, path)")
    path = as_path(path)
    if path.suffix.lower() != _ENDING:
        raise FrameError(f"{path}: frames are written as {_ENDING} alone, found "
                         f"{path.suffix or 'no ending'}")
    arrays: dict[str, Any] = {
        "depth": frame.depth,
        "depth_timestamp_us": np.int64(frame.depth_timestamp_us),
        "calibration": np.array(frame.calibration.to_json()),
        "registered": np.bool_(frame.registered),
        "depth_rounding": np.array(str(frame.depth_meaning.rounding)),
        "depth_unit_um": np.int64(frame.depth_meaning.unit_um),
    }
    if frame.depth_meaning.max_mm is not None:
        arrays["depth_max_mm"] = np.int64(frame.depth_meaning.max_mm)
    if frame.color is not None:
        arrays |= {"color": frame.color, "color_timestamp_us": np.int64(frame.color_timestamp_us)}
    for name in ("sensor", "captured_at", "source"):
        if text := getattr(frame.origin, name):
            arrays[name] = np.array(text[:_MAX_LINE])
    data = io.BytesIO()
    (np.savez if quickly else np.savez_compressed)(data, allow_pickle=False, **arrays)
    write_whole(path, [data.getvalue()], mode=mode, synced=not quickly)


def _rounding(text: str) -> DepthRounding:
    if text not in set(DepthRounding):
        raise FrameError(f"depth_rounding must be {', '.join(DepthRounding)}, found {text[:40]!r}")
    return DepthRounding(text)


def _text(path: str | Path, arrays: dict[str, NDArray[Any]], key: str, otherwise: str = "") -> str:
    if key not in arrays:
        return otherwise
    try:
        text = str(arrays[key])
    except (ValueError, SystemError) as error:
        raise FrameError(f"{path}: {key}: not Unicode text") from error
    if len(text) > _MAX_LINE or not text.isprintable():
        raise FrameError(f"{path}: {key}: expected one line of at most {_MAX_LINE} characters, "
                         f"found {text[:40]!r}")
    return text


def _own_calibration(path: str | Path, array: NDArray[Any]) -> Calibration:
    try:
        text = str(array)
    except (ValueError, SystemError) as error:
        raise FrameError(f"{path}: calibration: not Unicode text") from error
    return Calibration.from_json(text, name=f"{path}: calibration")
