"""Recordings and live sensors through OpenNI2.

How the library's faults are avoided:

- frames are copied at once (`_streams`): the next read reuses their memory;
- a frame is read only after it was announced, so that no read blocks for ever; nothing is sought;
- a file is checked first, where necessary mended (`oni`), and opened by an ASCII name (`_path`):
  others crash it;
- mirrored recordings are turned back: mirroring can be switched off on live sensors only;
- depth and colour are paired by their stamps (`capture.pairing`), or by their order in a recording
  whose stamps are wrong (`oni.recorded`);
- the library is loaded once, without its log (`_library`), and streams rest before they are
  destroyed (`_recording`).
"""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from denseface.capture.openni2._devices import available
    from denseface.capture.openni2._library import find_library as library_folder
    from denseface.capture.openni2._library import library_version
    from denseface.capture.openni2._live import LiveSource
    from denseface.capture.openni2._recording import RecordingSource
    from denseface.capture.openni2._sensor import WatchedSensor

__all__ = ["LiveSource", "RecordingSource", "WatchedSensor", "available", "library_folder",
           "library_version"]

_PLACES = {
    "LiveSource": "_live:LiveSource", "RecordingSource": "_recording:RecordingSource",
    "WatchedSensor": "_sensor:WatchedSensor", "available": "_devices:available",
    "library_folder": "_library:find_library", "library_version": "_library:library_version",
}
"""Who plays a recording waits for no module about sensors."""


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, there = _PLACES[name].split(":")
    return getattr(import_module(f"{__name__}.{module}"), there)


def __dir__() -> list[str]:
    return __all__
