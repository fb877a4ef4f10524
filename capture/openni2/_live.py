"""A live sensor from its opening to its closing: always the newest pair, by the calling thread."""

import time
from collections.abc import Iterator
from contextlib import suppress
from datetime import UTC, datetime, timedelta

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.errors import SensorError, SensorTimeoutError, WrongSizeError
from denseface.capture.frame import FrameOrigin, RgbdFrame
from denseface.capture.identity import Identity, find_calibration
from denseface.capture.live.clock import TRANSPORT_S
from denseface.capture.live.pairs import LivePair, LivePairs
from denseface.capture.live.ring import Ring
from denseface.capture.live.sensor import Shot
from denseface.capture.live.states import LiveFigures
from denseface.capture.openni2._base import OpenNI2Source
from denseface.capture.openni2._devices import choose, identity_of
from denseface.capture.openni2._library import (
    binding_errors,
    load,
    lost_devices,
    open_device,
)
from denseface.capture.openni2._streams import COLOR, DEPTH, Streams

_SLICE_S = 0.1
"""Longest single wait, seconds: Ctrl-C and an unplugged sensor are noticed in between."""
_SLOTS = 12
"""Frames of each stream in memory: 4 newest pairs, 4 that wait for a partner, one that is written,
and three that are looked at."""

_WARM_PAIRS = 10
"""Pairs after which the clocks are known."""


class LiveSource(OpenNI2Source):
    """A sensor; each step of an iteration gives the newest pair.

    Parameters
    ----------
    wanted : serial number, USB port or OpenNI2's URI of the device, or what it was known as
        before; None for the first one
    chosen : calibration; None for the one of this sensor in `calibration_folder()`, or what the
        sensor says of itself
    timeout_s : how long to wait for a pair
    start : start the streams at once; a recorder has to be attached before
    transport_s : longest time from a frame's exposure to its arrival

    Attributes
    ----------
    pairs : the clocks and what waits for a partner; there from the start of the streams on
    no_room : frames that were lost because all memory was held
    wrong_size : frames of another size than their mode's, which were dropped
    known_as : the sensor's serial number, USB port and URI

    Raises
    ------
    SensorError
        No such device, no depth stream, or the library is missing; while iterating, the
        device went away.
    SensorTimeoutError
        No pair came in time.
    """

    _live = True

    def __init__(
        self, wanted: str | Identity | None = None, chosen: ChosenCalibration | None = None, *,
        timeout_s: float = 5.0, start: bool = True, transport_s: float = TRANSPORT_S,
    ) -> None:
        name = wanted.name if isinstance(wanted, Identity) else wanted or ""
        super().__init__(f"openni2:{name}", chosen)
        self.timeout_s, self._transport_s = timeout_s, transport_s
        self.no_room = self.wrong_size = 0
        self._settled = self._locked = False
        load()
        # OpenNI2 would also open the name of a file.
        found = choose(wanted, self._name)
        with binding_errors(f"{self._name}: cannot be opened"):
            device = open_device(found.uri.encode())
        self._device_uri = bytes(device.uri)
        lost_devices.discard(self._device_uri)
        streams = self._opened = self._open_streams(device)
        try:
            self.known_as = identity_of(device)
            self._chosen = self._chosen or find_calibration(self.known_as)
        except BaseException:
            self.close()
            raise
        self._rings = {kind: Ring(_SLOTS, streams.frame_bytes(kind)) for kind in streams.kinds}
        self.pairs: LivePairs | None = None
        if start:
            self.start()

    def start(self) -> None:
        """Start both streams of a source that was made with `start=False`."""
        started_s = time.monotonic()
        self.streams.start()
        # Some sensors keep what another program locked; some take it while they stream only.
        self.streams.exposure.unlock()
        self.pairs = LivePairs(
            dict.fromkeys(self.streams.kinds, started_s), self._transport_s)

    def __iter__(self) -> Iterator[RgbdFrame]:
        while self._streams is not None:
            yield self.read()

    def read(self) -> RgbdFrame:
        """Wait for a pair that arrived after this call, and give it; the first few are left out.

        OpenNI2 keeps the newest frame of each stream, however old: by its stamp it is known.
        """
        asked_s = time.monotonic()
        while time.monotonic() < asked_s + self.timeout_s:
            pair = self.poll(_SLICE_S)
            if pair is None:
                continue
            try:
                if self.warm and pair.latest_s >= asked_s:
                    return self.shot(pair).frame
            finally:
                pair.release()
        clocks = self.pairs.clocks if self.pairs is not None else {}
        raise SensorTimeoutError(
            f"{self._name}: no {' and '.join(clocks)} pair within {self.timeout_s:g} s (received "
            + " and ".join(f"{clock.frames} {kind}" for kind, clock in clocks.items()) + " frames)")

    def poll(self, timeout_s: float) -> LivePair | None:
        """Wait for the next frame of either stream, copy it, and give the pair that it completes.

        The pair is held for the caller. A frame of a wrong size, or that finds no memory, is
        dropped and counted.

        Raises
        ------
        SensorError
            The device went away, or reading failed.
        """
        streams = self.streams
        kind = streams.wait(timeout_s)
        self._check_present()
        if kind is None or self.pairs is None:
            return None
        slot = self._rings[kind].claim()
        if slot is None:
            self.no_room += 1
            with suppress(WrongSizeError):
                streams.read(kind)
            return None
        try:
            stamp_us = streams.copy_frame(kind, slot.memory)
        except WrongSizeError:
            self.wrong_size += 1
            slot.release()
            if slot.memory.nbytes != streams.frame_bytes(kind):  # it keeps to another size
                self._rings[kind] = Ring(_SLOTS, streams.frame_bytes(kind))
            return None
        except BaseException:
            slot.release()
            raise
        pair = self.pairs.add(kind, slot, stamp_us, time.monotonic())
        if pair is not None and not self._settled:
            color = None if pair.color is None else streams.image(COLOR, pair.color.memory)
            self._settled = streams.exposure.settled(color)
        return pair

    def shot(self, pair: LivePair) -> Shot:
        """Make a frame of a pair that the caller holds; the source may be closed meanwhile."""
        streams = self._opened
        color = None if pair.color is None else streams.image(COLOR, pair.color.memory)
        doubt = streams.exposure.doubt if self._locked else ""
        middle_s = (pair.earliest_s + pair.latest_s) / 2
        taken = datetime.now(UTC) - timedelta(seconds=time.monotonic() - middle_s)
        origin = FrameOrigin(
            sensor=self.identity, captured_at=taken.isoformat(timespec="milliseconds"),
            source=f"openni2:{self.identity}",
            exposure_known_by=pair.exposure_known_by, skew_known_by=pair.skew_known_by,
            notes=pair.notes + ((doubt,) if doubt else ()))
        frame = self._make_frame(streams, streams.image(DEPTH, pair.depth.memory), color,
                                 (pair.depth_us, pair.color_us), origin)
        return Shot(frame, pair.number, pair.earliest_s, pair.latest_s)

    @property
    def warm(self) -> bool:
        """Whether enough pairs came: the clocks are known, the exposure has settled."""
        return self.pairs is not None and self.pairs.count >= _WARM_PAIRS and self._settled

    def lock_exposure(self, *, on: bool) -> None:
        """Keep exposure and white balance as they are, or let the camera find them again.

        What the driver cannot lock is said in the frames' notes.
        """
        exposure = self.streams.exposure
        (exposure.lock if on else exposure.unlock)()
        self._locked = on

    @property
    def figures(self) -> LiveFigures:
        """What happened since it was opened."""
        lost = self.no_room + self.wrong_size
        if self.pairs is None:
            return LiveFigures(drops=lost, wrong_size=self.wrong_size)
        clocks = self.pairs.clocks.values()
        return LiveFigures(
            self.pairs.count, lost + sum(clock.missed for clock in clocks), self.wrong_size,
            self.pairs.repeats, clock_jumps=sum(clock.jumps for clock in clocks),
            skew_us=self.pairs.skew_us)

    @property
    def period_s(self) -> float:
        """Measured time from pair to pair, seconds."""
        return _SLICE_S if self.pairs is None else self.pairs.period_s

    def silence(self) -> str:
        """Say, when no pair comes, what is missing."""
        if self.pairs is None:
            return f"{self._name}: the streams were not started"
        now_s = time.monotonic()
        silent = [kind for kind, last_s in self.pairs.last_new_s.items()
                  if now_s - last_s > 2 * _SLICE_S]
        if not silent:
            return f"{self._name}: its depth and color frames do not belong together"
        which = f"{silent[0]} stream" if len(silent) == 1 else "sensor"
        return f"{self._name}: the {which} has fallen silent or repeats itself"

    @property
    def identity(self) -> str:
        """What the sensor is known by: serial number, else USB port, else URI."""
        return self.known_as.name

    @property
    def streams(self) -> Streams:
        """The open streams.

        Raises
        ------
        SensorError
            The source was closed, or the device went away.
        """
        self._check_present()
        if self._streams is None:
            raise SensorError(f"{self._name}: is closed")
        return self._streams

    def _check_present(self) -> None:
        if self._device_uri in lost_devices:
            raise SensorError(
                f"{self._name}: the sensor {self._device_uri.decode()} was unplugged or failed")
