"""A live sensor as the capture process uses it, whatever the driver.

One that is made looks for its sensor, opens it, opens it again when it was lost, and never gives
up; all calls of the driver are made by a thread of its own. Whoever asks here never waits for the
driver.
"""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from denseface.capture.calibration_files import choose_calibration
from denseface.capture.frame import RgbdFrame
from denseface.capture.live.clock import TRANSPORT_S
from denseface.capture.live.states import LiveFigures, LiveState
from denseface.capture.source import ReplayOptions, class_named

__all__ = ["LiveSensor", "Shot", "open_sensor"]

_SENSORS = {"openni2:": "openni2:WatchedSensor"}
"""A sensor's scheme, and which class of which module of `capture` looks after it: called with what
follows the scheme, or None, the chosen calibration or None, and the rotation."""


@dataclass(frozen=True)
class Shot:
    """A pair of depth and colour, and when it was taken."""

    frame: RgbdFrame
    """With arrays of its own: it may be kept."""
    number: int
    """Of the pair since the sensor was opened; one that is missing was not asked for in time."""
    earliest_s: float
    """Neither image was exposed before, monotonic clock, seconds."""
    latest_s: float
    """Nor after."""


class LiveSensor(Protocol):
    """What looks after a live sensor; all may be called from any thread.

    Attributes
    ----------
    uri : what was asked for
    on_change : called, in the driver's thread, when the state changed, and when the first pair came
        after `latest` or `first_after` was called; must return at once and not raise
    """

    uri: str
    on_change: Callable[[], object]

    @property
    def state(self) -> LiveState:
        """Where the sensor is; it gives pairs while `STREAMING`."""

    @property
    def reason(self) -> str:
        """Why it does not stream, for the person who pressed; empty where it does."""

    @property
    def identity(self) -> str:
        """Serial number, else USB port, else address of the sensor last opened; else empty."""

    @property
    def figures(self) -> LiveFigures:
        """What happened since the start."""

    def latest(self) -> Shot | None:
        """Give the newest pair; None while the sensor does not stream."""

    def first_after(self, after_s: float, *, closely: bool = False) -> Shot | None:
        """Give the first pair of which both images were surely exposed at a time or later.

        None while there is none: `on_change` is called when to ask again. The pair after a shot is
        `first_after(math.nextafter(shot.earliest_s, math.inf))`.

        Parameters
        ----------
        after_s : monotonic clock, seconds
        closely : measure whether its depth and colour belong together, however short ago that was
            done: for a frame that becomes a face. It takes longer than to judge its quality.

        Raises
        ------
        MismatchedFrameError
            They do not, and that was to be measured.
        """

    def lock_exposure(self, *, on: bool) -> None:
        """Keep exposure and white balance as they are while a burst lasts, or no longer.

        It holds from one of the next frames on. What the driver cannot lock is a note of the frame.
        """

    def wait(self, number: int, timeout_s: float) -> bool:
        """Wait for a pair after that of a number; False where none came. For threads."""

    def needs_new_process(self) -> str:
        """Say why only another process can go on, as when the driver hangs; empty while none."""

    def close(self, timeout_s: float = 2.0) -> bool:
        """Close the sensor; False where the driver hangs, and the process is to be ended."""


def open_sensor(
    uri: str, calibration: Path | None = None, *, rotation: int = 0, raw: bool = False,
    transport_s: float = TRANSPORT_S,
) -> LiveSensor | None:
    """Begin to look after a live sensor, or to play a recording as if it were one (`rate=real`).

    None where the URI is that of another kind of source.

    Parameters
    ----------
    uri, calibration, rotation, raw : as of `open_source`
    transport_s : longest time from a frame's exposure to its arrival

    Raises
    ------
    CalibrationError
        The calibration cannot be read.
    DriverError
        What the sensor needs is not installed.
    CaptureError
        The recording cannot be read.
    """
    _, options = ReplayOptions.split(uri)
    if options is not None and options.real_time:
        replay: LiveSensor = class_named("replay:ReplaySensor")(
            uri, calibration, rotation, raw=raw)
        return replay
    scheme, colon, address = uri.partition(":")
    name = _SENSORS.get(scheme.lower() + colon)
    if name is None:
        return None
    sensor: LiveSensor = class_named(name)(
        address or None, choose_calibration(None, calibration), rotation, raw=raw,
        transport_s=transport_s)
    return sensor
