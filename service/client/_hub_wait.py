"""What a client does while there is no connection to the hub."""

import time
from collections.abc import Callable

from denseface.service.errors import ClientTimeoutError
from denseface.service.transport.connection import ConnectionMonitor

__all__ = ["HubWait"]

_SAY_S = 1.0
"""Time without a connection until that is said, seconds: one to a hub that is there takes less."""


class HubWait:
    """Says once that a hub is waited for and why, and waits for the first connection so long.

    Parameters
    ----------
    address : the hub's
    connect_timeout : longest wait for a first connection, seconds; None for as long as a call may
        take
    say : is given the line, once; None to say nothing
    """

    def __init__(
        self, address: str, connect_timeout: float | None, say: Callable[[str], None] | None
    ) -> None:
        self._address = address
        self._connect_timeout = connect_timeout
        self._say = say
        self._since: float | None = None
        self._was_connected = False

    def end(self) -> None:
        """Note that there is a connection."""
        self._since, self._was_connected = None, True

    def look(self, monitor: ConnectionMonitor) -> None:
        """Note how a connection is now; ClientTimeoutError where the first one takes too long."""
        if monitor.connected:
            self.end()
            return
        now = time.monotonic()
        if self._since is None:
            self._since = now
        waited = now - self._since
        if self._say and waited >= _SAY_S:
            self._say(f"waiting for the hub at {self._address}: {monitor.why_not()}")
            self._say = None
        if (self._connect_timeout is not None and not self._was_connected
                and waited >= self._connect_timeout):
            self._since = None  # another call waits anew
            raise ClientTimeoutError(f"{self._address}: no connection to the hub within "
                                     f"{self._connect_timeout:g} s: {monitor.why_not()}")
