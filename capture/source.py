"""Where frames come from: `open_source(uri)` gives a `Source`, an iterable of `RgbdFrame`.

================== ===============================================================================
URI                what it opens
================== ===============================================================================
``NAME.npz``       one frame in the project's own format
``NAME.oni``       a recording, through OpenNI2
``openni2:``       the first live sensor that OpenNI2 finds
``openni2:URI``    the live sensor of that OpenNI2 URI
================== ===============================================================================
"""

from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Protocol, Self, runtime_checkable

from denseface.capture._calibration_choice import choose_calibration
from denseface.capture.calibration import Calibration
from denseface.capture.errors import UnreadableSourceError
from denseface.capture.frame import RgbdFrame

__all__ = ["Source", "open_source"]

_LIVE = "openni2:"
_ACCEPTED = "accepted: NAME.npz, NAME.oni, openni2: or openni2:URI"


@runtime_checkable
class Source(Protocol):
    """A sensor, a recording or a single frame: iterate over it inside a `with` block.

    Each pass over a recording starts at its first frame; a live sensor goes on for ever and each
    step gives the newest pair.
    """

    @property
    def uri(self) -> str:
        """What was opened."""

    @property
    def frame_count(self) -> int | None:
        """How many frames one pass gives at most; None for a live sensor."""

    def __iter__(self) -> Iterator[RgbdFrame]: ...

    def __enter__(self) -> Self: ...

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None: ...

    def close(self) -> None:
        """Let go of the sensor or file; harmless when repeated."""


def open_source(
    uri: str | Path, calibration: Calibration | str | Path | None = None
) -> Source:
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
    if text.lower().startswith(_LIVE):
        from denseface.capture.openni2 import LiveSource

        return LiveSource(text[len(_LIVE):] or None, choose_calibration(None, calibration))
    path = Path(text)
    kind = path.suffix.lower()
    if kind not in (".npz", ".oni"):
        raise UnreadableSourceError(f"{text}: not a known kind of source; {_ACCEPTED}")
    if not path.is_file():
        found = "is a folder, not a file" if path.is_dir() else "no such file"
        raise UnreadableSourceError(f"{text}: {found}")
    if kind == ".npz":
        from denseface.capture.npz import NpzSource

        return NpzSource(path, choose_calibration(path, calibration))
    from denseface.capture.openni2 import RecordingSource

    return RecordingSource(path, choose_calibration(path, calibration))
