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

from denseface.capture.openni2._devices import available
from denseface.capture.openni2._library import find_library as library_folder
from denseface.capture.openni2._library import library_version
from denseface.capture.openni2._live import LiveSource
from denseface.capture.openni2._recording import RecordingSource
from denseface.capture.openni2._sensor import WatchedSensor

__all__ = ["LiveSource", "RecordingSource", "WatchedSensor", "available", "library_folder",
           "library_version"]
