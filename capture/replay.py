"""Recordings, frame files and folders of them played as asked for, or as if they were live."""

import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from statistics import median

from denseface.capture.calibration import Calibration
from denseface.capture.errors import CaptureError, UnreadableSourceError
from denseface.capture.frame import RgbdFrame
from denseface.capture.live.sensor import LiveSensor, Shot
from denseface.capture.live.states import LiveFigures, LiveState
from denseface.capture.source import ReplayOptions, Source, open_source

__all__ = ["Replay", "ReplaySensor"]

_PERIOD_S = 1 / 30
"""Between frames whose stamps do not say, seconds."""
_MAX_PERIOD_S = 1.0
"""Longest pause between two frames, seconds: more is a gap in the recording, or a clock that
jumped."""
_KEPT = 4
"""Newest frames that are kept for who asks a little later."""


class Replay(Source):
    """A source that is played by options.

    Raises
    ------
    UnreadableSourceError
        There is no frame of the number that is asked for.
    """

    def __init__(self, source: Source, options: ReplayOptions) -> None:
        self._source, self._options = source, options
        self.uri = source.uri
        self.repeats = not options.stops
        count = source.frame_count
        if options.frame is not None:
            if count is not None and options.frame >= count:
                source.close()
                raise UnreadableSourceError(f"{source.uri}: has {count} frames (0 to {count - 1}), "
                                            f"frame={options.frame} asks for another")
            count = 1
        self.frame_count = count

    def __iter__(self) -> Iterator[RgbdFrame]:
        frames = self.chosen()
        return (frame for frame, _ in paced(frames)) if self._options.real_time else frames

    def chosen(self) -> Iterator[RgbdFrame]:
        """Give the frames of a pass as fast as they are asked for."""
        number = self._options.frame
        return iter(self._source) if number is None else islice(self._source, number, number + 1)

    @property
    def rotation(self) -> int:
        """Of what is played."""
        return self._source.rotation

    @rotation.setter
    def rotation(self, degrees: int) -> None:
        self._source.rotation = degrees

    def look_closely(self, *, refuse: bool = False) -> None:
        """Measure the next frame of what is played."""
        self._source.look_closely(refuse=refuse)

    def close(self) -> None:
        """Close what is played."""
        self._source.close()


def paced(
    frames: Iterable[RgbdFrame], start_s: float | None = None, *,
    wait: Callable[[float], object] = time.sleep, clock: Callable[[], float] = time.monotonic,
) -> Iterator[tuple[RgbdFrame, float]]:
    """Give each frame when it is due, and when that is.

    A frame is due as long after the one before as its stamp says. Those that were due while nobody
    asked are left out, as a live sensor's; where reading is slower than the recording, it is
    played more slowly.

    Parameters
    ----------
    start_s : when the first is due; None for at once
    wait : waits so many seconds
    clock : seconds
    """
    asked_s = clock()
    due_s = asked_s if start_s is None else start_s
    steps: deque[float] = deque([_PERIOD_S], maxlen=9)
    last_us: int | None = None
    for frame in frames:
        if last_us is not None:
            step = (frame.depth_timestamp_us - last_us) / 1e6
            step = step if 0 < step <= _MAX_PERIOD_S else median(steps)
            steps.append(step)
            due_s += step
        last_us = frame.depth_timestamp_us
        if due_s < asked_s - _PERIOD_S / 2:
            continue
        now_s = clock()
        if now_s < due_s:
            wait(due_s - now_s)
        else:
            due_s = max(due_s, now_s - _PERIOD_S)
        yield frame, due_s
        asked_s = clock()


class ReplaySensor(LiveSensor):
    """A recording as a live sensor: its first frame is exposed now, each next one at its time.

    Parameters
    ----------
    uri, calibration, rotation, raw : as of `open_source`

    Raises
    ------
    CaptureError
        As `open_source`.
    """

    def __init__(self, uri: str, calibration: Calibration | str | Path | None = None,
                 rotation: int = 0, *, raw: bool = False) -> None:
        self.uri = uri
        self.on_change: Callable[[], object] = lambda: None
        self._state, self._reason = LiveState.OPENING, "the recording is being opened"
        source = open_source(uri, calibration, rotation=rotation, raw=raw)
        self._source = source if isinstance(source, Replay) else Replay(source, ReplayOptions())
        self._changed = threading.Condition()
        self._shots: deque[Shot] = deque(maxlen=_KEPT)
        self._count = 0
        self._asked = False
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)
        self._thread.start()

    @property
    def state(self) -> LiveState:
        """`STREAMING` from the first frame to the last."""
        return self._state

    @property
    def reason(self) -> str:
        """Why no frame comes; empty while they do."""
        return self._reason

    @property
    def identity(self) -> str:
        """The recording."""
        return self.uri

    @property
    def figures(self) -> LiveFigures:
        """How many frames were played."""
        with self._changed:
            skew_us = self._shots[-1].frame.skew_us if self._shots else 0
            return LiveFigures(frames=self._count, skew_us=skew_us)

    def latest(self) -> Shot | None:
        """Give the newest frame."""
        return self._find(float("-inf"), newest=True)

    def first_after(self, after_s: float, *, closely: bool = False) -> Shot | None:  # noqa: ARG002
        """Give the first frame that was due at a time or later, monotonic clock.

        closely : nothing; frames are prepared when they are read
        """
        return self._find(after_s, newest=False)

    def lock_exposure(self, *, on: bool) -> None:
        """Nothing: a recording's exposure is what it was."""

    def wait(self, number: int, timeout_s: float) -> bool:
        """Wait for a frame after that of a number."""
        with self._changed:
            return self._changed.wait_for(
                lambda: bool(self._shots) and self._shots[-1].number > number, timeout_s)

    def needs_new_process(self) -> str:
        """Never: there is no driver that could hang."""
        return ""

    def close(self, timeout_s: float = 2.0) -> bool:
        """End the thread."""
        self._stop.set()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _find(self, after_s: float, *, newest: bool) -> Shot | None:
        with self._changed:
            shots = reversed(self._shots) if newest else iter(self._shots)
            found = next((shot for shot in shots if shot.earliest_s >= after_s), None)
            self._asked = True  # what is found may not be new enough, and others may ask too
        return found

    def _run(self) -> None:
        """Play until told to stop; for the thread."""
        start_s: float | None = None  # the first frame is never late
        try:
            while not self._stop.is_set():
                for frame, due_s in paced(self._source.chosen(), start_s, wait=self._stop.wait):
                    if self._stop.is_set():
                        return
                    self._give(frame, due_s)
                    start_s = due_s + _PERIOD_S
                if not self._count:
                    self._end("the recording holds no pair of depth and color")
                    return
                # What begins late is left out; where that is all of it, it would be for ever.
                start_s = max(start_s or 0.0, time.monotonic())
                if not self._source.repeats:
                    self._end("the recording is at its end")
                    return
        except CaptureError as error:
            self._end(str(error))
        finally:
            self._source.close()

    def _give(self, frame: RgbdFrame, due_s: float) -> None:
        origin = replace(frame.origin, exposure_known_by="stamps")
        earlier_s = min(due_s, due_s - frame.skew_us / 1e6)
        later_s = max(due_s, due_s - frame.skew_us / 1e6)
        with self._changed:
            self._count += 1
            self._shots.append(Shot(replace(frame, origin=origin), self._count, earlier_s, later_s))
            opened = self._state is not LiveState.STREAMING
            self._state, self._reason = LiveState.STREAMING, ""
            tell = opened or self._asked
            self._asked = False
            self._changed.notify_all()
        if tell:
            self.on_change()

    def _end(self, reason: str) -> None:
        with self._changed:
            self._shots.clear()
            self._state, self._reason = LiveState.ABSENT, f"{self.uri}: {reason}"
            self._changed.notify_all()
        self.on_change()
