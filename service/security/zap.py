"""ZeroMQ's authentication protocol (ZAP, RFC 27), answered in the hub's own loop.

No thread of its own can die unnoticed. While nobody answers, `ZAP_ENFORCE_DOMAIN` makes libzmq
refuse every connection.
"""

from collections.abc import Callable

import zmq
import zmq.utils.z85

from denseface.service.monitoring import Rejections
from denseface.service.security._allow_list import AllowedKey, AllowList

__all__ = ["MESSAGES_DOMAIN", "PUBLICATIONS_DOMAIN", "Authenticator"]

MESSAGES_DOMAIN, PUBLICATIONS_DOMAIN = b"denseface", b"denseface.topics"
"""ZAP domains of the sockets for messages and of those for publications."""

_ENDPOINT = "inproc://zeromq.zap.01"
"""Where libzmq asks (RFC 27)."""
_VERSION = b"1.0"
"""Version of ZAP."""
_MAX_BURST = 64
"""Requests answered before the loop looks at other sockets."""


class Authenticator:
    """Answers, for all sockets of this context, whether a key may connect.

    Parameters
    ----------
    is_permitted : whether an allowed key may connect to the sockets of a domain
    has_room : whether it may connect now; else it may try again
    """

    def __init__(
        self, context: "zmq.Context[zmq.Socket[bytes]]", allow_list: AllowList,
        rejections: Rejections, is_permitted: Callable[[AllowedKey, bytes], bool],
        has_room: Callable[[AllowedKey, bytes], bool],
    ) -> None:
        self._allow_list = allow_list
        self._rejections = rejections
        self._is_permitted = is_permitted
        self._has_room = has_room
        # A ROUTER, for a REP that failed to answer could receive no further request.
        self.socket = context.socket(zmq.ROUTER)
        self.socket.set(zmq.LINGER, 0)
        self.socket.bind(_ENDPOINT)

    def answer(self) -> None:
        """Answer the requests that are waiting."""
        for _ in range(_MAX_BURST):
            try:
                parts = self.socket.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                return
            envelope, request = parts[:2], parts[2:]
            status = self._status(request)
            number = request[1] if len(request) > 1 else b""
            self.socket.send_multipart([*envelope, _VERSION, number, *status, b""])

    def close(self) -> None:
        """Close the socket: libzmq refuses every new connection."""
        self.socket.close()

    def _status(self, request: list[bytes]) -> list[bytes]:
        """Give the status code, its text and the user."""
        user = self._user(request)
        if user is None:
            return [b"400", b"refused", b""]
        domain, address = request[2:4]
        if not self._has_room(user, domain):
            self._rejections.note("connections", address=address.decode("ascii", "replace"),
                                  key=user.name, detail="too many of one key")
            return [b"300", b"too many connections", b""]
        return [b"200", b"OK", user.public.encode()]

    def _user(self, request: list[bytes]) -> AllowedKey | None:
        if len(request) != 7 or request[0] != _VERSION:
            self._rejections.note("handshake", detail="not a request of ZAP 1.0")
            return None
        _, _, domain, address, _, mechanism, key = request
        where = address.decode("ascii", "replace")
        if mechanism != b"CURVE" or len(key) != 32:
            self._rejections.note(
                "handshake", address=where, detail=f"mechanism {mechanism[:16]!r}, not CURVE")
            return None
        public = zmq.utils.z85.encode(key).decode()
        user = self._allow_list.get(public)
        if user is None:
            self._rejections.note("unknown key", address=where, key=public)
            return None
        if not self._is_permitted(user, domain):
            self._rejections.note(
                "role", address=where, key=user.name, detail="no topic for its roles")
            return None
        return user
