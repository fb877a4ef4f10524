"""Where frames come from: `open_source(uri)` gives a `Source`, an iterable of `RgbdFrame`.

================== ===============================================================================
URI                what it opens
================== ===============================================================================
``NAME.npz``       one frame in the project's own format
``NAME.oni``       a recording, through OpenNI2
``FOLDER``         the frames of its ``.npz`` files, in the order of their names; else image pairs,
                   as data sets have them (TUM RGB-D, ScanNet, Open3D)
``openni2:``       the first live sensor that OpenNI2 finds
``openni2:NAME``   the live sensor of that serial number, USB port or OpenNI2 URI
================== ===============================================================================

What is read from files may end in ``?`` and options of `ReplayOptions`, such as
``NAME.oni?rate=real&end=stop``.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from importlib import import_module
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, Self, runtime_checkable

from denseface.arguments import as_path, describe
from denseface.capture.calibration import Calibration
from denseface.capture.calibration_files import choose_calibration
from denseface.capture.errors import DriverError, MismatchedFrameError, UnreadableSourceError
from denseface.capture.frame import RgbdFrame
from denseface.capture.rotation import ROTATIONS
from denseface.missing import missing

if TYPE_CHECKING:
    from denseface.capture.preparation import FramePreparation

__all__ = ["ReplayOptions", "Source", "class_named", "is_folder_of_pairs", "open_source"]

_SOURCES = {
    ".npz": "npz:NpzSource",
    ".oni": "openni2:RecordingSource",
    "/*.npz": "npz:FolderSource",
    "/": "image_pair:FolderSource",
    "openni2:": "openni2:LiveSource",
}
"""A file's ending (`/` of a folder) or a sensor's scheme, and which class of which module of
`capture` opens it.

The class is imported when first needed, and called with the file's path (of a sensor: with what
follows the scheme, or None) and the chosen calibration or None.
"""

_FOLDERS = {"/*.npz": ".npz", "/": "image pairs"}
"""What may be in a folder."""


@dataclass(frozen=True)
class ReplayOptions:
    """How what was recorded is played.

    Attributes
    ----------
    real_time : ``rate=real``: each frame at its time after the first, as of a live sensor;
        ``rate=asked``, the default: the next one whenever one is asked for
    stops : ``end=stop``: no frame after the last; ``end=loop``, the default: the first again
    frame : ``frame=N``: that one alone, from 0; None for all
    """

    real_time: bool = False
    stops: bool = False
    frame: int | None = None

    @classmethod
    def split(cls, uri: str) -> tuple[str, Self | None]:
        """Split options from a URI; None where it has none.

        A file may have a ``?`` in its name, and a sensor in its address, as Freenect's have:
        ``freenect://0?serial=A00``.

        Raises
        ------
        UnreadableSourceError
            An option is unknown, or has no value that it may have.
        """
        name, mark, text = uri.rpartition("?")
        if not mark or f"{uri.partition(':')[0].lower()}:" in _SOURCES or Path(uri).exists():
            return uri, None
        given: dict[str, str] = {}
        for option in text.split("&"):
            key, _, value = option.partition("=")
            valid = value in _OPTIONS[key] if key in _OPTIONS else (
                key == "frame" and value.isdecimal() and len(value) < _MAX_DIGITS)
            if not valid or key in given:
                raise UnreadableSourceError(
                    f"{uri}: {option or text!r}: expected rate=asked or rate=real, end=loop or "
                    "end=stop, frame=N, each once")
            given[key] = value
        frame = given.get("frame")
        return name, cls(given.get("rate") == "real", given.get("end") == "stop",
                         None if frame is None else int(frame))


_OPTIONS = {"rate": ("asked", "real"), "end": ("loop", "stop")}
_MAX_DIGITS = 10


@runtime_checkable
class Source(Protocol):
    """A sensor, a recording or a single frame: iterate over it inside a `with` block.

    Each pass over a recording starts at its first frame; a live sensor goes on for ever and each
    step gives the newest pair.
    """

    uri: str
    """What was opened."""
    frame_count: int | None
    """How many frames one pass gives at most; None for a live sensor."""
    repeats: bool = True
    """Whether who wants more frames than a pass gives begins another."""
    rotation: int = 0
    """Degrees by which frames are turned, clockwise: 0, 90, 180 or 270."""
    raw: bool = False
    """Frames are given as they are, for a recording: neither measured nor turned."""
    _preparation: "FramePreparation | None" = None

    def __iter__(self) -> Iterator[RgbdFrame]: ...

    def close(self) -> None:
        """Release the sensor or file; harmless when repeated."""

    def prepared(self, frame: RgbdFrame) -> RgbdFrame:
        """Give a frame of this source as its user gets it: put right where needed, and turned.

        Each source passes its frames through this, as its images and calibration make them.

        Raises
        ------
        MismatchedFrameError
            Depth and colour do not belong together, and `look_closely` was told to refuse that.
        """
        if self.raw:
            return frame
        try:
            return self._prepare().of(frame)
        except MismatchedFrameError as error:
            raise MismatchedFrameError(f"{self.uri}: {error}") from error

    def look_closely(self, *, refuse: bool = False) -> None:
        """Measure whether depth and colour of the next frame belong together.

        refuse : raise where they do not; otherwise the frame has a note
        """
        self._prepare().look_closely(refuse=refuse)

    def _prepare(self) -> "FramePreparation":
        if self._preparation is None:
            # Imported late: who only asks for frames' types needs no OpenCV.
            module = import_module("denseface.capture.preparation")
            self._preparation = module.FramePreparation(self.rotation)
        return self._preparation

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_source(
    uri: str | Path, calibration: Calibration | str | Path | None = None, *, rotation: int = 0,
    raw: bool = False,
) -> Source:
    """Open a recording, a frame file or a live sensor.

    Parameters
    ----------
    uri : see the table above
    calibration : a calibration or the path of one (JSON); it wins over ``NAME.calibration.json``
        beside the recording, which wins over what the recording or sensor says of itself, which
        wins over the defaults of the sensor's kind. `RgbdFrame.calibration_origin` says which.
    rotation : degrees by which frames are turned, clockwise, as of a sensor on its side: 0, 90, 180
        or 270
    raw : give frames as they are, for a recording: neither measured nor turned

    Raises
    ------
    UnreadableSourceError
        The file is missing, damaged or of no known kind.
    CalibrationError
        A calibration cannot be read.
    TypeError, ValueError
        An argument is of another type, or no such rotation.
    FrameError
        A frame file's arrays are not as they should be.
    DriverError
        The OpenNI2 library or its binding is missing or cannot be used.
    SensorError
        The device or one of its streams is missing.
    """
    text = str(as_path(uri, "uri")) if not isinstance(uri, str) else uri
    if not isinstance(calibration, Calibration | str | PathLike | None):
        raise TypeError("calibration: expected Calibration, str or Path, found "
                        + describe(calibration))
    if rotation not in ROTATIONS:
        raise ValueError(f"rotation: expected 0, 90, 180 or 270 degrees, found {rotation!r}")
    text, options = ReplayOptions.split(text)
    scheme, colon, address = text.partition(":")
    kind, path = scheme.lower() + colon, None
    if not colon or kind not in _SOURCES:
        path = Path(text)
        kind = path.suffix.lower()
        if kind not in _SOURCES and text and path.is_dir():
            kind = "/" if is_folder_of_pairs(path) else "/*.npz"
        if kind not in _SOURCES:
            raise UnreadableSourceError(f"{text}: not a known kind of source; {_accepted()}")
        if not path.is_file() and not kind.startswith("/"):
            found = ("is a folder, not a file" if path.is_dir() else
                     "is not a regular file" if path.exists() else "no such file")
            raise UnreadableSourceError(f"{text}: {found}")
    source: Source = class_named(_SOURCES[kind])(
        path or address or None, choose_calibration(path, calibration))
    source.rotation, source.raw = rotation, raw
    if options is None:
        return source
    replay: Source = class_named("replay:Replay")(source, options)
    return replay


def is_folder_of_pairs(path: Path) -> bool:
    """Whether a path is that of a folder of image pairs: one without frame files."""
    return path.is_dir() and not any(path.glob("*.npz"))


def class_named(name: str) -> Any:
    """Import a class of `capture` by its ``module:name``.

    Raises
    ------
    DriverError
        What the module needs is not there, or not for this Python.
    """
    module, name = name.split(":")
    try:
        return getattr(import_module(f"denseface.capture.{module}"), name)
    except ImportError as error:
        raise DriverError(str(missing(error, "capture") or error)) from error


def _accepted() -> str:
    forms = [form for kind in _SOURCES
             for form in ((f"NAME{kind}",) if kind.startswith(".") else
                          (f"a folder of {_FOLDERS[kind]}",) if kind in _FOLDERS else
                          (kind, f"{kind}URI"))]
    return f"accepted: {', '.join(forms[:-1])} or {forms[-1]}"
