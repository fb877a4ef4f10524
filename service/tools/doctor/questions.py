"""What the doctor asks of OpenNI2, in a process of its own: drivers hang and crash.

Each answer is printed as one line of JSON as soon as it is there, so that of a driver that hangs it
is known at which question.
"""

import json
import sys
import time
from dataclasses import asdict
from itertools import islice

from denseface.capture import CaptureError, RgbdFrame
from denseface.capture.openni2 import LiveSource, available, library_version

__all__ = ["main"]

_FRAME_S = 5.0
"""Longest wait for a pair of frames, seconds."""


def main(uri: str | None = None) -> None:
    """List the sensors that are there, or look at the one of a URI; answers go to stdout."""
    try:
        if uri is None:
            _say("loading")
            _say("library", version=library_version())
            _say("sensors", sensors=[asdict(sensor) for sensor in available()])
        else:
            _look_at(uri)
    except CaptureError as error:
        _say("error", text=str(error))


def _look_at(uri: str) -> None:
    _say("opening")
    with LiveSource(uri, timeout_s=_FRAME_S) as source:
        streams = source.streams
        _say("open", name=source.identity, uri=source.known_as.uri,
             offered={kind: len(modes) for kind, modes in streams.offered.items()},
             chosen={kind: str(streams.mode(kind)) for kind in streams.kinds})
        started_s = time.monotonic()
        frame = next(islice(source, 1, None))  # the second: the first may have been long in coming
        _say("frame", seconds=time.monotonic() - started_s, **_facts(frame))
        _say("closing")
    _say("closed")


def _facts(frame: RgbdFrame) -> dict[str, object]:
    return {
        "skew_ms": None if frame.color is None else frame.skew_us / 1000,
        "skew_known_by": frame.origin.skew_known_by,
        "coverage": float((frame.depth > 0).mean()),
        "registered": frame.registered,
        "calibration": frame.calibration_origin,
        "brightness": None if frame.color is None else float(frame.color.mean()),
        "notes": list(frame.origin.notes),
    }


def _say(step: str, **answers: object) -> None:
    print(json.dumps({"step": step} | answers), flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:2])
