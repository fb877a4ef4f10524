"""The control channel: what a test says to the virtual sensor while it runs, and what it hears.

A file of one device, mapped by the test and by the driver. A test writes a field; the driver looks
at each frame, at each call, and every few milliseconds for what happens by itself (a plug pulled).
"""

import enum
import mmap
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from tests.virtual_sensor.shared_words import Block, Choice, Count, Flag, Number, Real, Text
from tests.waiting import LIMIT_S, until

__all__ = ["Call", "Control", "DeviceState", "Driver", "Format", "Honesty", "Mode", "OpenFault",
           "Stamps", "StreamControl", "layout_header"]


class Call(enum.IntFlag):
    """Calls of the library into the driver, each of which can hang."""

    NONE = 0
    OPEN = 1
    CLOSE = 2
    CREATE_STREAM = 4
    DESTROY_STREAM = 8
    START = 16
    STOP = 32
    GET_PROPERTY = 64
    SET_PROPERTY = 128
    SHUTDOWN = 256


class Driver(enum.IntEnum):
    """Whose answers about itself the sensor gives."""

    PRIMESENSE = 0
    """ZPD, ZPPS, LDDIS and DCRCDIS as in the clip."""
    FREENECT = 1
    """The constants of libfreenect's driver, whatever the device: ZPPS 0.1052, a colour field of
    view of 62 degrees; no DCRCDIS, no serial number, no synchronization. Its faults too: once
    closed it cannot be opened again in the process, asking for registration before there is a
    depth stream crashes, AUTO_EXPOSURE switches the white balance, mirroring is off by a pixel."""
    ORBBEC = 2
    """As PrimeSense, and the factory calibration of both cameras as device property 14."""
    BARE = 3
    """Nothing but the video mode: no field of view, no constants, no serial number."""


class OpenFault(enum.IntEnum):
    """What happens at an attempt to open the device."""

    NONE = 0
    BUSY = 1
    """Another process has it: refused, as PS1080 words it."""
    NO_PERMISSION = 2
    """The device file may not be written: refused, as PS1080 words it."""


class DeviceState(enum.IntEnum):
    """OpenNI2's states of a device."""

    OK = 0
    ERROR = 1
    NOT_READY = 2


class Stamps(enum.IntEnum):
    """What a stream's time stamps are."""

    SENSOR = 0
    """Microseconds of the sensor's own clock, which starts at 1 s when the device is opened."""
    NONE = 1
    """Always 0."""
    MILLISECONDS = 2
    """As `SENSOR`, in the wrong unit."""
    EPOCH = 3
    """Microseconds since 1970, by the host's clock."""
    ARRIVAL = 4
    """Microseconds of the sensor's clock when the frame is delivered, not when it was exposed."""


class Honesty(enum.IntEnum):
    """What a switch of the sensor does and says."""

    HONEST = 0
    IDLE = 1
    """Setting succeeds, and is read back, and nothing happens."""
    SECRET = 2
    """It acts, and is read back as off."""
    STUCK = 3
    """It acts as it was at the start; setting succeeds and is read back, and changes nothing."""
    MISSING = 4
    """There is no such property: it acts as it was at the start."""
    REFUSED = 5
    """It can be read, and setting fails."""


class Format(enum.StrEnum):
    """Pixel formats."""

    DEPTH_1_MM = "1mm"
    DEPTH_100_UM = "100um"
    RGB888 = "rgb888"
    YUV422 = "yuv422"
    """U Y V Y, as OpenNI2 names it."""
    YUYV = "yuyv"


@dataclass(frozen=True)
class Mode:
    """A video mode that a stream offers."""

    width: int = 640
    height: int = 480
    fps: int = 30
    format: Format = Format.DEPTH_1_MM

    def __str__(self) -> str:
        return f"{self.width}x{self.height}@{self.fps}:{self.format}"


class StreamControl(Block):
    """The words of one stream."""

    present = Flag(True)
    """Whether the device has this stream; read when it is opened."""
    modes = Text(size=512)
    """What is offered, see `offer`; empty: 640x480@30 (the clip's size) as 1 mm or RGB888."""
    silent = Flag()
    """No frame is sent, without a word."""
    frozen = Flag()
    """The same image again and again, with new stamps."""
    frozen_stamps = Flag()
    """While frozen the stamp and the frame's index stay the same too."""
    drop_next = Number()
    """So many frames are lost; counted down by the driver."""
    drop_per_mille = Number()
    """So many of a thousand frames are lost, always the same ones."""
    garbled_next = Number()
    """So many frames are noise (-1: all); counted down by the driver."""
    wrong_size_next = Number()
    """So many frames are half as high as the mode says (-1: all); counted down by the driver."""
    delay_us = Number()
    """This stream is exposed so much later than the other, truly, microseconds."""
    stamps = Choice(Stamps.SENSOR)
    """What the stamps are."""
    stamp_offset_us = Number()
    """Added to the stamps: a jump, or another clock; microseconds."""
    drift_ppm = Real()
    """The stamps' clock runs so much too fast, millionths."""
    mirroring = Choice(Honesty.HONEST)
    """What the property MIRRORING does and says."""
    mirrored_at_start = Flag(True)
    """As real sensors start."""
    cropping = Choice(Honesty.HONEST)
    """What the property CROPPING does and says."""
    crop_left = Number()
    """Cropping that is on at the start, pixels; off where `crop_width` is 0."""
    crop_top = Number()
    """Pixels."""
    crop_width = Number()
    """Pixels."""
    crop_height = Number()
    """Pixels."""
    frames = Count()
    """Frames sent."""
    lost = Count()
    """Frames lost: dropped on command, and those the machine was too slow for."""
    created = Count()
    """Streams created."""
    destroyed = Count()
    """Streams destroyed."""
    running = Count()
    """Whether it streams (of the last process that opened it)."""
    last_exposed_ns = Count()
    """When the frame that was sent last was exposed, `time.monotonic_ns`."""

    def offer(self, *modes: Mode) -> None:
        """Say what the stream offers; the first is the one it starts with."""
        self.modes = ",".join(map(str, modes))


class Control(Block):
    """One virtual device: make it, give it to `environment`, and write its fields.

    Parameters
    ----------
    path : of the file to be made
    clip : what `write_clip` wrote
    fields : the device's fields to begin with; those of a stream are set through `depth`, `color`
    """

    clip = Text(size=512)
    """The frame file; read when the device is opened."""
    uri = Text("virtual:0")
    """Read when it is plugged in."""
    vendor = Text("denseface")
    """As OpenNI2 says it."""
    name = Text("virtual sensor")
    """As OpenNI2 says it."""
    usb_vendor = Number()
    """USB vendor id."""
    usb_product = Number()
    """USB product id."""
    serial = Text()
    """Serial number; empty: the property is not supported."""
    driver = Choice(Driver.PRIMESENSE)
    """Whose answers it gives."""
    plugged = Flag(True)
    """Whether it is there; written while it runs: unplugged and plugged in again."""
    plugs = Number()
    """Times the plug was pulled: see `unplug`."""
    announced = Flag(True)
    """Whether the library lists it: no where the driver leaves out what it cannot open."""
    hotplug = Flag(True)
    """Whether the driver says that it came or went; where not, it looks only when it is loaded."""
    state = Choice(DeviceState.OK)
    """Told to the library when it changes; frames come on all the same."""
    open_fault = Choice(OpenFault.NONE)
    """What happens at an attempt to open it."""
    hang = Choice(Call.NONE)
    """These calls do not come back until this is cleared."""
    refuse = Choice(Call.NONE)
    """These calls fail at once (start, createStream, getProperty, setProperty)."""
    first_frame_us = Number()
    """From the start of the streams to the first exposure, beside one period, microseconds."""
    pipeline_us = Number()
    """From a frame's exposure to its delivery, microseconds."""
    jitter_us = Number()
    """Up to so much more, another time for each frame, microseconds."""
    speed = Real(1.0)
    """So many times the frames per second that the mode says; read when the device is opened."""
    loop = Flag(True)
    """Whether the clip begins again; otherwise silence after its last frame."""
    unplug_after = Number(-1)
    """Unplugged after so many frames of the device; -1: never."""
    skips = Flag(True)
    """On a machine that is too slow frames are lost, as on a real sensor; else they are late."""
    marks = Flag()
    """Each image carries its number and the time of its exposure in its first rows: `read_mark`."""
    settle_frames = Number()
    """The colour camera's exposure and white balance settle over so many frames after its start:
    from less than half of the brightness, and too red."""
    breathing_per_mille = Number()
    """So much the brightness goes up and down, by its mean, as long as exposure is automatic."""
    camera_controls = Flag(True)
    """Whether there are AUTO_EXPOSURE, AUTO_WHITE_BALANCE and EXPOSURE (100 when settled), which
    can be set while the colour stream runs."""
    registration = Choice(Honesty.MISSING)
    """What the property IMAGE_REGISTRATION does and says."""
    factory_blank = Flag()
    """Orbbec's factory calibration is not a number, as of an Astra Pro."""
    registered_at_start = Flag()
    """Depth is in the colour camera's pixels at the start."""
    synchronized = Flag()
    """Both streams are exposed at once, `delay_us` notwithstanding (the library may set it too)."""
    opens = Count()
    """Times the device was opened."""
    closes = Count()
    """Times it was closed."""
    loads = Count()
    """Processes that loaded the driver."""
    entered = Count()
    """Calls that hung so far."""
    hanging = Choice(Call.NONE)
    """The call that hangs now."""

    def __init__(self, path: Path, clip: Path | None = None, **fields: Any) -> None:
        self.path = path
        path.write_bytes(bytes(_SIZE))
        with path.open("r+b") as file:
            super().__init__(mmap.mmap(file.fileno(), _SIZE))
        self.depth = StreamControl(self.memory, self.SIZE)
        self.color = StreamControl(self.memory, self.SIZE + StreamControl.SIZE)
        for block in (self, self.depth, self.color):
            block.reset()
        if clip is not None:
            self.clip = str(clip)
        self.update(fields)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let the file go; a driver that has it goes on."""
        self.memory.close()

    def unplug(self) -> None:
        """Pull the plug."""
        self.plugged = False
        self.plugs += 1

    def replug(self, uri: str | None = None) -> None:
        """Put the plug in, perhaps under another URI."""
        if uri is not None:
            self.uri = uri
        self.plugged = True

    def wait_frames(self, count: int = 1, within_s: float = LIMIT_S) -> None:
        """Wait until each stream that is there has sent so many frames more."""
        streams = [one for one in (self.depth, self.color) if one.present]
        wanted = [one.frames + count for one in streams]
        until(lambda: all(one.frames >= n for one, n in zip(streams, wanted, strict=True)),
              within_s)

    def wait_hanging(self, call: Call, within_s: float = LIMIT_S) -> None:
        """Wait until a call hangs."""
        until(lambda: call in self.hanging, within_s)


_SIZE = Control.SIZE + 2 * StreamControl.SIZE
"""Bytes of the file."""


def layout_header() -> str:
    """Give the C++ header of the file's layout, which the driver is compiled with."""
    lines = ["// Made by tests/virtual_sensor/control.py.", "#pragma once", "#include <atomic>",
             "#include <cstdint>", *_enums((Call, Driver, OpenFault, Stamps, Honesty)),
             *StreamControl.struct("StreamControl"), *Control.struct("DeviceControl"),
             "struct Control { DeviceControl device; StreamControl depth, color; };",
             f"static_assert(sizeof(Control) == {_SIZE});"]
    return "\n".join(lines) + "\n"


def _enums(kinds: Iterable[type[enum.IntEnum] | type[enum.IntFlag]]) -> Iterable[str]:
    for kind in kinds:
        members = ", ".join(f"{name} = {int(value)}" for name, value in kind.__members__.items())
        yield f"namespace {kind.__name__} {{ enum : int64_t {{ {members} }}; }}"
