"""Looking after a live sensor, in a thread of its own: the only one that calls the driver."""

import threading
import time
from collections.abc import Callable

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.errors import CaptureError, SensorError, WrongSizeError
from denseface.capture.identity import Identity, usb_devices
from denseface.capture.live.clock import TRANSPORT_S
from denseface.capture.live.pairs import LivePair, PairLog
from denseface.capture.live.sensor import LiveSensor, Shot
from denseface.capture.live.states import HANG_S, LiveEvent, LiveFigures, LiveState, LiveStates
from denseface.capture.live.usb import UsbWatch
from denseface.capture.openni2._devices import find, why_absent
from denseface.capture.openni2._library import find_library, watched_sensors
from denseface.capture.openni2._live import LiveSource

_SLICE_S = 0.1
"""Longest wait for a frame at once, seconds: an unplugged sensor is noticed in between."""
_LOOK_S = 0.2
"""Time between two looks for a sensor that is not there or cannot be had, seconds."""
_RETRY_S, _MAX_RETRY_S = 1.0, 5.0
"""Pause before a sensor that refused is asked again, or was opened in vain, once more for each time
in a row, and the longest, seconds."""
_SILENT_PERIODS, _SILENT_S = 5, 0.3
"""A sensor without a new pair for so many periods, and so many seconds, is silent."""
_MAX_AWAY_S = 5.0
"""So long may looks take more than twice a slice, in all, before that is a silence: it is the
driver then that does not come back from them, and not this machine that stood still."""


class WatchedSensor(LiveSensor):
    """A sensor that is looked for, opened, and opened again when it was lost.

    Parameters
    ----------
    wanted : serial number, USB port or OpenNI2's URI of the device; None for any one
    chosen : calibration; None for what the sensor says of itself
    rotation : degrees by which frames are turned, clockwise
    raw : give frames as they are, see `open_source`
    transport_s : longest time from a frame's exposure to its arrival

    Raises
    ------
    DriverError
        The library is not there.
    """

    def __init__(
        self, wanted: str | None = None, chosen: ChosenCalibration | None = None,
        rotation: int = 0, *, raw: bool = False, transport_s: float = TRANSPORT_S,
    ) -> None:
        find_library()
        self.uri = f"openni2:{wanted or ''}"
        self.on_change: Callable[[], object] = lambda: None
        self._wanted, self._chosen = wanted, chosen
        self._rotation, self._raw, self._transport_s = rotation, raw, transport_s
        self._lock_exposure = self._exposure_locked = False
        self._states = LiveStates(time.monotonic())
        self._past = LiveFigures()
        """Of the time before the sensor was opened last."""
        self._usb = UsbWatch(usb_devices())
        self._in_vain = 0
        """How often it was opened since it streamed last."""
        self._stuck = ""
        """Why only another process can go on."""
        self._known_as: Identity | None = None
        """The sensor that was open last."""
        self._found: Identity | None = None
        """The one that is to be opened."""
        self._source: LiveSource | None = None
        self._log = PairLog()
        self._asked = False
        """Whether somebody asked for a pair since the last one came. What was given may not be new
        enough, and others may have asked too."""
        self._last_pair_s = 0.0
        self._looked_s = 0.0
        """When the driver's thread last looked for a pair."""
        self._away_s = 0.0
        """How long it did not look since the last one came, as where this machine stood still."""
        self._called_s = time.monotonic()
        """When the driver's thread last showed itself."""
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="sensor", daemon=True)
        self._thread.start()
        watched_sensors.add(self)

    # --- for any thread

    @property
    def state(self) -> LiveState:
        return self._states.state

    @property
    def reason(self) -> str:
        return self._states.reason

    @property
    def identity(self) -> str:
        return "" if self._known_as is None else self._known_as.name

    def lock_exposure(self, *, on: bool) -> None:
        self._lock_exposure = on

    @property
    def figures(self) -> LiveFigures:
        source, past = self._source, self._past
        return past if source is None else past + source.figures

    def latest(self) -> Shot | None:
        return self._shot(self._log.newest)

    def first_after(self, after_s: float, *, closely: bool = False) -> Shot | None:
        return self._shot(lambda: self._log.first_after(after_s), closely=closely)

    def wait(self, number: int, timeout_s: float) -> bool:
        return self._log.wait(number, timeout_s)

    def needs_new_process(self) -> str:
        state, silent_s = self.state, time.monotonic() - self._called_s
        if not self._thread.is_alive():
            return "the thread that calls the driver has failed"
        if silent_s > HANG_S[state]:
            return f"the driver hangs ({state.value} for {silent_s:.1f} s)"
        return self._stuck

    def close(self, timeout_s: float = HANG_S[LiveState.CLOSING]) -> bool:
        self._stop.set()
        self._thread.join(timeout_s)
        return not self._thread.is_alive()

    def _shot(self, find: Callable[[], LivePair | None], *, closely: bool = False) -> Shot | None:
        source = self._source
        self._asked = True  # before the look: a pair that comes in between is told
        pair = find() if source is not None else None
        if pair is None or source is None:
            return None
        if closely:
            source.look_closely(refuse=True)
        try:
            return source.shot(pair)
        except WrongSizeError:  # the driver has changed the size meanwhile
            return None
        finally:
            pair.release()

    # --- for the driver's thread alone

    def _run(self) -> None:
        while not self._stop.is_set():
            self._called_s = time.monotonic()
            _STEPS[self._states.state](self)
        self._called_s = time.monotonic()
        self._shut()

    def _advance(self, event: LiveEvent, reason: str = "") -> None:
        self._called_s = time.monotonic()
        before = self._states.state
        after = self._states.advance(event, self._called_s, reason)
        if after in (LiveState.OPENING, LiveState.CLOSING):
            # Whoever waits for `on_change` is to look when the driver hangs.
            timer = threading.Timer(HANG_S[after] + 0.01, lambda: self.on_change())
            timer.daemon = True
            timer.start()
        if after is not before:
            self.on_change()

    def _look(self) -> None:
        """Look for the sensor while it is absent or cannot be had."""
        try:
            found, listed = find(self._wanted)
            if found is None and self._wanted is not None and self._known_as is not None:
                found, listed = find(self._known_as)
        except SensorError as error:
            self._advance(LiveEvent.REFUSED, str(error))
            self._stop.wait(_RETRY_S)
            return
        unlisted = self._usb.unlisted(
            usb_devices(), [sensor.uri for sensor in listed], time.monotonic())
        if unlisted and (found is None or self._states.state is LiveState.BLOCKED):
            self._stuck = f"{unlisted} was plugged in, and OpenNI2 in this process does not list it"
            self.on_change()
        self._found = found
        if found is not None:
            blocked = self._states.state is LiveState.BLOCKED
            self._stop.wait(_RETRY_S if blocked else min(self._in_vain * _RETRY_S, _MAX_RETRY_S))
            if blocked:
                self._open()
            else:
                self._advance(LiveEvent.FOUND, "the sensor is being opened")
            return
        self._in_vain = 0  # what is plugged in anew is not what gave nothing
        if self._states.state is LiveState.BLOCKED:
            self._advance(LiveEvent.LOST)
        if self._known_as is None:
            self._states.explain(why_absent(self.uri.rstrip(":"), listed))
        self._stop.wait(_LOOK_S)

    def _open(self) -> None:
        try:
            source = LiveSource(self._found, self._chosen, transport_s=self._transport_s)
            source.rotation, source.raw = self._rotation, self._raw
        except Exception as error:  # whatever a driver makes the binding raise
            known = isinstance(error, CaptureError)
            self._advance(LiveEvent.REFUSED, str(error) if known else f"{self.uri}: {error!r}")
            return
        self._source, self._exposure_locked = source, False
        self._in_vain += 1
        self._past += LiveFigures(reconnects=int(self._known_as is not None))
        self._known_as = source.known_as
        self._usb.know(usb_devices())
        self._last_pair_s = self._looked_s = time.monotonic()
        self._advance(LiveEvent.OPENED, "the sensor was just opened and is warming up")

    def _serve(self) -> None:
        """Take what comes; notice when nothing does."""
        source = self._source
        if source is None:
            raise RuntimeError("no sensor is open")
        try:
            if self._lock_exposure is not self._exposure_locked:
                self._exposure_locked = self._lock_exposure
                source.lock_exposure(on=self._exposure_locked)
            pair = source.poll(_SLICE_S)
        except SensorError as error:
            self._advance(LiveEvent.LOST, str(error))
            return
        now_s = time.monotonic()
        away_s, self._looked_s = now_s - self._looked_s, now_s
        if pair is not None:
            self._away_s = 0.0
            self._take(source, pair)
            return
        if away_s > 2 * _SLICE_S and self._away_s < _MAX_AWAY_S:
            self._away_s += away_s
            self._last_pair_s += away_s
            return
        if self._states.state is LiveState.STREAMING and (
                now_s - self._last_pair_s > max(_SILENT_PERIODS * source.period_s, _SILENT_S)):
            self._log.clear()
            self._past += LiveFigures(stalls=1)
            self._advance(LiveEvent.SILENT, source.silence())
        elif self._states.overdue(now_s):
            self._advance(LiveEvent.LOST, source.silence())

    def _take(self, source: LiveSource, pair: LivePair) -> None:
        self._last_pair_s = time.monotonic()
        if self._states.state is LiveState.WARMING:
            if not source.warm:
                pair.release()
                return
            self._in_vain = 0
            self._advance(LiveEvent.WARM)
        elif self._states.state is LiveState.STALLED:
            self._advance(LiveEvent.FRAME)
        self._log.add(pair)
        if self._asked:
            self._asked = False
            self.on_change()

    def _close(self) -> None:
        self._shut()
        self._advance(LiveEvent.CLOSED)

    def _shut(self) -> None:
        self._log.clear()
        source, self._source = self._source, None
        if source is not None:
            self._past += source.figures
            source.close()


_STEPS: dict[LiveState, Callable[[WatchedSensor], None]] = {
    LiveState.ABSENT: WatchedSensor._look,
    LiveState.BLOCKED: WatchedSensor._look,
    LiveState.OPENING: WatchedSensor._open,
    LiveState.WARMING: WatchedSensor._serve,
    LiveState.STREAMING: WatchedSensor._serve,
    LiveState.STALLED: WatchedSensor._serve,
    LiveState.CLOSING: WatchedSensor._close,
}
"""What the driver's thread does in each state, over and over."""
