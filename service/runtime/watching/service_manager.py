"""What a process tells the service manager that started it: sd_notify(3), without a library."""

import socket
import time
from collections.abc import Callable, MutableMapping
from contextlib import suppress

from denseface.service.runtime.closing import Closing

__all__ = ["ServiceManager"]

_FEEDS = 4
"""Signs of life in the time after which a process is restarted: two would do, were none late."""
_MAX_STATUS = 200
"""Longest status, characters."""


class ServiceManager(Closing):
    """Takes its variables from the environment, so that no child speaks for its parent.

    Says nothing where there is no service manager, or it does not listen. Nothing waits: what a
    busy one does not take at once is said again with the next sign of life.

    Parameters
    ----------
    environment : without the variables, after this
    clock : seconds
    """

    def __init__(self, environment: MutableMapping[str, str],
                 clock: Callable[[], float] = time.monotonic) -> None:
        address = environment.pop("NOTIFY_SOCKET", "")
        limit_us = environment.pop("WATCHDOG_USEC", "")
        environment.pop("WATCHDOG_PID", None)
        self.limit_s = float(limit_us) / 1e6 if limit_us.isdecimal() else None
        """Silence after which this process is restarted, seconds; None for never."""
        self._clock = clock
        self._fed: float | None = None
        """When the last sign of life was given."""
        self._status = ""
        self._ready = False
        self._unsaid: dict[str, str] = {}
        """By variable, in order: the newest is what counts."""
        self._socket: socket.socket | None = None
        if address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
            with suppress(OSError):
                self._socket.connect(address.replace("@", "\0", 1) if address[0] == "@"
                                     else address)

    def need(self, silence_s: float) -> None:
        """Have the limit raised to a silence that is nothing strange of this process, seconds."""
        if self.limit_s is not None and self.limit_s < silence_s:
            self.limit_s = silence_s
            self._say(f"WATCHDOG_USEC={round(silence_s * 1e6)}")

    def alive(self) -> None:
        """Say that this process makes progress, as often as is needed: call it in the loop."""
        self._say_what_is_unsaid()
        if self.limit_s is None:
            return
        now = self._clock()
        if self._fed is None or now - self._fed >= self.limit_s / _FEEDS:
            self._fed = now
            self._say("WATCHDOG=1")
            self._unsaid.pop("WATCHDOG", None)  # what is late is no sign of life

    def step(self, status: str, within_s: float) -> None:
        """Say how far a start is; where that is news, the next step has so long, seconds.

        A start that gets stuck is then ended, whoever repeats how far it is.
        """
        if self.status(status):
            self._say(f"EXTEND_TIMEOUT_USEC={round(within_s * 1e6)}")

    def ready(self, status: str = "") -> None:
        """Say, once, that this process is of use now."""
        if not self._ready:
            self._ready = True
            self._say("READY=1")
        self.status(status)

    def status(self, text: str) -> bool:
        """Say in one line how it is, and give whether that is news; ids have no place in it."""
        line = " ".join(text.split())[:_MAX_STATUS]
        if not line or line == self._status:
            return False
        self._status = line
        self._say(f"STATUS={line}")
        return True

    def stopping(self) -> None:
        """Say that this process ends, in order."""
        self._say("STOPPING=1")

    def close(self) -> None:
        """Say nothing more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None

    def _say(self, state: str) -> None:
        name, _, value = state.partition("=")
        self._unsaid.pop(name, None)
        self._unsaid[name] = value
        self._say_what_is_unsaid()

    def _say_what_is_unsaid(self) -> None:
        while self._socket is not None and self._unsaid:
            name, value = next(iter(self._unsaid.items()))
            try:
                self._socket.send(f"{name}={value}".encode(errors="replace"))
            except BlockingIOError:
                return
            except OSError:
                self._unsaid.clear()
                return
            del self._unsaid[name]
