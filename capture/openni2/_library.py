"""Finding and loading OpenNI2: once for each process, quietly, and never after a fork."""

import atexit
import os
import sys
import sysconfig
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from weakref import WeakSet

from denseface.capture.errors import CaptureError, DriverError, SensorError
from denseface.capture.openni2._binding import OpenNIError, c_api, openni2

open_sources: WeakSet[Any] = WeakSet()
"""Sources that may be open: closed before the library is unloaded, where their owner forgets to."""
watched_sensors: WeakSet[Any] = WeakSet()
"""What looks after sensors in threads of their own: closed before the sources."""
lost_devices: set[bytes] = set()
"""URIs of the devices that were unplugged since they were opened."""

_NAME = "libOpenNI2.so"
"""File name of the library."""
_VARIABLES = ("OPENNI2_REDIST64", "OPENNI2_REDIST")
"""Environment variables that name its folder."""
_LEAVING_S = 6.0
"""Longest time to close everything when the process ends, seconds."""
_ERRORS_ONLY = 3
"""OpenNI2's log severity."""

_lock = threading.Lock()
_loaded_pid: int | None = None
_listener: Any = None


def find_library() -> Path:
    """Give the folder that holds `libOpenNI2.so`.

    The environment variables OPENNI2_REDIST64 and OPENNI2_REDIST name it; otherwise Debian's
    multiarch folder and the usual ones are searched.

    Raises
    ------
    DriverError
        It is not there; the message names the Debian package.
    """
    for variable in _VARIABLES:
        if value := os.environ.get(variable):
            folder = Path(value).absolute()
            if (folder / _NAME).is_file():
                return folder
            raise DriverError(f"{variable}={value}: no {_NAME} in that folder")
    multiarch = sysconfig.get_config_var("MULTIARCH")
    roots = [Path("/usr/lib"), Path("/usr/local/lib")]
    folders = [root / str(multiarch) for root in roots if multiarch] + roots
    for folder in folders:
        if (folder / _NAME).is_file():
            return folder
    raise DriverError(
        f"{_NAME} not found in {', '.join(map(str, folders))}: install the Debian package "
        f"libopenni2-dev (apt install libopenni2-dev), or name the folder in OPENNI2_REDIST")


def library_version() -> str:
    """Load the library and give its version; raises as `load`."""
    load()
    with binding_errors("OpenNI2 does not say its version"):
        version = openni2.get_version()
    return f"{version.major}.{version.minor}.{version.maintenance}.{version.build}"


def load() -> None:
    """Load and initialise the library, until the process ends: a second initialisation crashes.

    Raises
    ------
    DriverError
        The library is missing or refuses.
    SensorError
        The process was forked after it was loaded.
    """
    global _loaded_pid, _listener
    with _lock:
        if _loaded_pid is not None:
            if _loaded_pid != os.getpid():
                raise SensorError("OpenNI2 was loaded before this process was forked: start "
                                  "processes by spawn, or open the sensor in the child alone")
            return
        folder = find_library()
        try:
            c_api.load_dll(str(folder / _NAME))
            _silence_logging()
            # The binding's own loading would change the working directory.
            openni2.loaded_dll_directory = str(folder)
            openni2.initialize()
            _silence_logging()
            _listener = _Listener()
        except (OSError, AttributeError, ValueError, OpenNIError) as error:
            raise DriverError(f"{folder / _NAME}: OpenNI2 cannot be loaded: "
                              f"{error_text(error)}") from error
        # Before the binding's own clean-up, which destroys streams in any order.
        atexit.register(_Leaving().leave)
        _loaded_pid = os.getpid()


class _Leaving:
    """Closes everything when the process ends, and ends it where the driver hangs in that.

    The thread is there from the start: an interpreter that ends starts none.
    """

    def __init__(self) -> None:
        self._due, self._done = threading.Event(), threading.Event()
        self._pid = os.getpid()
        threading.Thread(target=self._close_all, name="openni2-end", daemon=True).start()

    def leave(self) -> None:
        """Have everything closed; does not return where that takes too long."""
        if os.getpid() != self._pid:
            return  # a forked child: OpenNI2 and the thread are its parent's
        self._due.set()
        if not self._done.wait(_LEAVING_S):
            with suppress(OSError, ValueError):
                print(f"denseface: OpenNI2 or its driver hangs; ended without it after "
                      f"{_LEAVING_S:g} s", file=sys.stderr)
                sys.stdout.flush()
                sys.stderr.flush()
            os._exit(1)

    def _close_all(self) -> None:
        # At the first call of a thread, OpenNI2 asks whether those that called before still live
        # (pthread_kill), and crashes where the memory of one is gone: seen at the end, on Python
        # 3.13. So this thread makes its first call while they all do.
        c_api.oniGetExtendedError()
        self._due.wait()
        try:
            for source in [*watched_sensors, *open_sources]:
                source.close()
            openni2.unload()
        finally:
            self._done.set()


@contextmanager
def binding_errors(what: str, kind: type[CaptureError] = SensorError) -> Iterator[None]:
    """Turn an error of the binding into one of `kind` that says what failed."""
    try:
        yield
    except OpenNIError as error:
        raise kind(f"{what}: {error_text(error)}") from error


def open_device(uri: bytes) -> Any:
    """Open a device of the binding, so that another attempt is possible where this one fails.

    Raises
    ------
    OpenNIError
        It cannot be opened.
    """
    device = openni2.Device.__new__(openni2.Device)
    try:
        device.__init__(uri)
    except BaseException:
        # OpenNI2 makes a handle of a device that it could not open. Once that is closed, as the
        # binding's finaliser would, it counts minus one opening, does not open the device at the
        # next attempt, and crashes at the first call.
        device._handle = None
        raise
    return device


def close_handle(handle: Any) -> None:
    """Close a device or stream of the binding; one that is gone may refuse."""
    try:
        handle.close()
    except OpenNIError:
        # Else its finaliser would try again and print a traceback.
        handle._handle = None


def error_text(error: BaseException) -> str:
    """Give an error of the binding in one line."""
    message = error.args[1] if len(error.args) > 1 else None
    if isinstance(message, bytes) and message:
        return " ".join(message.decode("utf-8", "replace").split())
    code = getattr(error, "code", None)
    return repr(code).split(".")[-1] if code is not None else str(error) or type(error).__name__


def _silence_logging() -> None:
    """Create no Log folder in the working directory and print nothing."""
    c_api.oniSetLogFileOutput(False)
    c_api.oniSetLogConsoleOutput(False)
    c_api.oniSetLogMinSeverity(_ERRORS_ONLY)


class _Listener(openni2.DeviceListener):  # type: ignore[misc]
    """Records lost devices. The binding's own handlers use sets that do not exist yet."""

    def _on_connected(self, info: Any, _: Any) -> None:
        """A device that came back has to be opened anew: it stays lost."""

    def _on_disconnected(self, info: Any, _: Any) -> None:
        lost_devices.add(bytes(info[0].uri))

    def _on_state_changed(self, info: Any, state: Any, _: Any) -> None:
        """An error may pass; where it does not, the sensor falls silent, which is noticed."""
