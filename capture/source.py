"""Where frames come from: `open_source(uri)` gives a `Source`, an iterable of `RgbdFrame`.

================== ===============================================================================
URI                what it opens
================== ===============================================================================
``NAME.npz``       one frame in the project's own format
``NAME.oni``       a recording, through OpenNI2
``FOLDER``         image pairs, as data sets have them (TUM RGB-D, ScanNet, Open3D)
``openni2:``       the first live sensor that OpenNI2 finds
``openni2:URI``    the live sensor of that OpenNI2 URI
================== ===============================================================================
"""

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Protocol, Self, runtime_checkable

from denseface.capture.calibration import Calibration
from denseface.capture.calibration_files import choose_calibration
from denseface.capture.errors import UnreadableSourceError
from denseface.capture.frame import RgbdFrame

__all__ = ["Source", "open_source"]

_SOURCES = {
    ".npz": "npz:NpzSource",
    ".oni": "openni2:RecordingSource",
    "/": "image_pair:FolderSource",
    "openni2:": "openni2:LiveSource",
}
"""A file's ending (`/` of a folder) or a sensor's scheme, and which class of which module of
`capture` opens it.

The class is imported when first needed, and called with the file's path (of a sensor: with what
follows the scheme, or None) and the chosen calibration or None.
"""


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

    def __iter__(self) -> Iterator[RgbdFrame]: ...

    def close(self) -> None:
        """Release the sensor or file; harmless when repeated."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_source(uri: str | Path, calibration: Calibration | str | Path | None = None) -> Source:
    """Open a recording, a frame file or a live sensor.

    Parameters
    ----------
    uri : see the table above
    calibration : a calibration or the path of one (JSON); it wins over ``NAME.calibration.json``
        beside the recording, which wins over what the recording or sensor says of itself, which
        wins over the defaults of the sensor's kind. `RgbdFrame.calibration_origin` says which.

    Raises
    ------
    UnreadableSourceError
        The file is missing, damaged or of no known kind.
    CalibrationError
        A calibration cannot be read.
    FrameError
        A frame file's arrays are not as they should be.
    SensorError
        The OpenNI2 library, the device or one of its streams is missing.
    """
    text = str(uri)
    scheme, colon, address = text.partition(":")
    kind, path = scheme.lower() + colon, None
    if not colon or kind not in _SOURCES:
        path = Path(text)
        kind = path.suffix.lower()
        if kind not in _SOURCES and text and path.is_dir():
            kind = "/"
        if kind not in _SOURCES:
            raise UnreadableSourceError(f"{text}: not a known kind of source; {_accepted()}")
        if not path.is_file() and kind != "/":
            found = ("is a folder, not a file" if path.is_dir() else
                     "is not a regular file" if path.exists() else "no such file")
            raise UnreadableSourceError(f"{text}: {found}")
    module, name = _SOURCES[kind].split(":")
    opener = getattr(import_module(f"denseface.capture.{module}"), name)
    source: Source = opener(path or address or None, choose_calibration(path, calibration))
    return source


def _accepted() -> str:
    forms = [form for kind in _SOURCES
             for form in ((f"NAME{kind}",) if kind.startswith(".") else
                          ("a folder of image pairs",) if kind == "/" else (kind, f"{kind}URI"))]
    return f"accepted: {', '.join(forms[:-1])} or {forms[-1]}"
