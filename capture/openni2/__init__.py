"""Recordings and live sensors through OpenNI2.

The library's traps and what is done about them:

- frames are copied at once (`_openni2_streams`), since the next read reuses their memory;
- nothing is read that was not announced, so nothing can block for ever; nothing is sought;
- a file is checked before the library sees it (`_oni_file`), and given an ASCII name
  (`_openni2_path`): others crash it;
- what a recording holds mirrored is turned back, as switching it off works on live sensors alone;
- depth and colour are paired by their stamps (`sync`);
- the library is loaded once and quietly (`_openni2_library`), streams rest before they are
  destroyed (`_openni2_recording`).
"""

from denseface.capture.openni2._live import LiveSource
from denseface.capture.openni2._recording import RecordingSource

__all__ = ["LiveSource", "RecordingSource"]
