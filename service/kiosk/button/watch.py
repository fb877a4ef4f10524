"""Looks after the button: opens it, reads it, and opens it again when it was plugged in again."""

import asyncio
import fcntl
import os
import stat
import time
from collections.abc import Callable
from pathlib import Path

import structlog

from denseface.service.errors import SettingsError
from denseface.service.kiosk.button.presses import Presses

__all__ = ["check_button", "watch_button"]

_EVIOCGRAB = 0x40044590
"""`_IOW('E', 0x90, int)` of `linux/input.h`: gives the device's records to this program alone."""
_AGAIN_S = 0.5
"""Time until a button that is not there is looked for again, seconds."""
_READ_BYTES = 4096
_log = structlog.get_logger("kiosk")


def check_button(path: Path) -> None:
    """Raise SettingsError where a path is of something else; a button may be plugged in later."""
    try:
        mode = path.stat().st_mode
    except OSError:
        return
    if not (stat.S_ISCHR(mode) or stat.S_ISFIFO(mode)):
        raise SettingsError(
            f"--kiosk-button {path}: expected an input device, such as /dev/input/by-id/...")


async def watch_button(
    path: Path, pressed: Callable[[], None], *, grab: bool = False,
    clock: Callable[[], float] = time.monotonic,
) -> None:
    """Call `pressed` at each press until cancelled; what keeps it from that is said once.

    A named pipe of the same records is read like a device.

    Parameters
    ----------
    grab : take the device from all other programs, so that its key does nothing else
    clock : seconds
    """
    said = ""
    while True:
        try:
            descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        except OSError as error:
            why = error.strerror or str(error)
        else:
            try:
                _begin(path, descriptor, grab=grab)
                why = await _read(descriptor, pressed, clock)
            finally:
                os.close(descriptor)
            said = ""
        if why != said:
            said = why
            _log.warning("no button; it is looked for", button=str(path), reason=why)
        await asyncio.sleep(_AGAIN_S)


def _begin(path: Path, descriptor: int, *, grab: bool) -> None:
    if grab:
        try:
            fcntl.ioctl(descriptor, _EVIOCGRAB, 1)
        except OSError as error:
            _log.warning("the button is shared with other programs: it could not be taken from "
                         "them", button=str(path), reason=error.strerror)
    _log.info("button", button=str(path))


async def _read(
    descriptor: int, pressed: Callable[[], None], clock: Callable[[], float]
) -> str:
    """Read until there is nothing more to come, and give why."""
    loop = asyncio.get_running_loop()
    gone: asyncio.Future[str] = loop.create_future()
    presses = Presses()

    def take() -> None:
        try:
            data = os.read(descriptor, _READ_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            data, why = b"", error.strerror or str(error)
        else:
            why = "it was unplugged"
        if data:
            for _ in range(presses.feed(data, clock())):
                pressed()
        elif not gone.done():
            gone.set_result(why)

    loop.add_reader(descriptor, take)
    try:
        return await gone
    finally:
        loop.remove_reader(descriptor)
