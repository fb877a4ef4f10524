"""The connections of the LAN door, and limits on those who open them: anybody in the room."""

import asyncio
import socket

from denseface.service.kiosk.web.connections import BoundedHttp

__all__ = ["LanConnection", "show_what_is_left"]

_MAX_OF_ADDRESS = 12
"""Connections of one address at once: a browser opens six."""
_SEND_BUFFER_BYTES = 2**16
"""Of a connection in the kernel: what a client has not taken is seen to be left, but for this."""


def show_what_is_left(listening: socket.socket) -> None:
    """Let the kernel take little for the connections to come."""
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER_BYTES)


class LanConnection(BoundedHttp):
    """One of a client's few connections; sends only once what was sent before is taken.

    The application has the transport in its scope's state.
    """

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Take a connection, where there is room."""
        super().connection_made(transport)
        if transport.is_closing():
            return
        transport.set_write_buffer_limits(high=1, low=0)
        self.app_state = {**self.app_state, "transport": transport}
        others = [one for one in self.connections if isinstance(one, LanConnection)]
        if sum(one._address == self._address for one in others) > _MAX_OF_ADDRESS:
            transport.abort()

    @property
    def _address(self) -> str:
        return self.client[0] if self.client else ""
