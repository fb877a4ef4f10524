"""Tells a service manager that the supervisor lives: sd_notify(3), without a library."""

import socket
from collections.abc import MutableMapping
from contextlib import suppress

from denseface.service.runtime.closing import Closing

__all__ = ["ServiceManager"]


class ServiceManager(Closing):
    """Takes its variables from the environment, so that no child speaks for its parent.

    Says nothing where there is no service manager, or it does not listen.
    """

    def __init__(self, environment: MutableMapping[str, str]) -> None:
        address = environment.pop("NOTIFY_SOCKET", "")
        limit_us = environment.pop("WATCHDOG_USEC", "")
        environment.pop("WATCHDOG_PID", None)
        self.limit_s = float(limit_us) / 1e6 if limit_us.isdecimal() else None
        """Silence after which the supervisor is restarted, seconds; None for never."""
        self._socket: socket.socket | None = None
        if address:
            self._socket = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
            self._socket.setblocking(False)
            with suppress(OSError):
                self._socket.connect(address.replace("@", "\0", 1) if address[0] == "@"
                                     else address)

    def say(self, state: str) -> None:
        """Say `READY=1`, `WATCHDOG=1` or `STOPPING=1`, without waiting."""
        if self._socket is not None:
            with suppress(OSError):
                self._socket.send(state.encode())

    def close(self) -> None:
        """Say nothing more."""
        if self._socket is not None:
            self._socket.close()
            self._socket = None
