"""A connection to the hub: its keys, and why the hub refuses it."""

import errno
import struct
import time
from contextlib import suppress
from dataclasses import dataclass
from typing import Self

import zmq

from denseface.service.errors import KeyFileError, KeyRefusedError, RemoteProtocolError
from denseface.service.protocol.wire import Packet, decode_from_hub, readable
from denseface.service.security import KeyPair, read_pair, read_public
from denseface.service.settings import ServiceSettings
from denseface.service.transport.absence import why_absent
from denseface.service.transport.addresses import socket_file
from denseface.service.transport.sockets import Context, Socket, open_monitor, open_socket

_MIN_BROKEN_OFF = 3
"""Handshakes that break off in a row until the keys are blamed: a hub may have ended in one."""
_RECONNECT_S = 2.0
"""Time until a refused daemon connects again, seconds: its key may be allowed meanwhile."""
_E = zmq.Event
_EVENTS = (_E.DISCONNECTED | _E.HANDSHAKE_SUCCEEDED | _E.HANDSHAKE_FAILED_AUTH
           | _E.HANDSHAKE_FAILED_PROTOCOL | _E.HANDSHAKE_FAILED_NO_DETAIL)


@dataclass(frozen=True)
class Credentials:
    """One's own key pair and the hub's public key."""

    pair: KeyPair
    hub: str

    @classmethod
    def of(cls, settings: ServiceSettings) -> Self | None:
        """Read the keys that the settings name; None where they name none.

        A socket file is local: no keys are read for it. KeyFileError where a key file cannot be
        used, or one of the two is missing.
        """
        key, hub = settings.key, settings.hub_key
        if settings.address.startswith("ipc://") or (key is None and hub is None):
            return None
        if key is None or hub is None:
            missing = "--hub-key FILE, the hub's public one" if key else "--key FILE, your own"
            raise KeyFileError(f"{settings.address}: one key without the other: expected {missing}")
        pair, public = read_pair(key), read_public(hub)
        if public in (pair.public, pair.secret):
            raise KeyFileError(f"--hub-key is the {'public' if public == pair.public else 'secret'}"
                               f" key of {key}, your own: expected the hub's public one, "
                               "hub.public of its machine")
        return cls(pair, public)

    def apply(self, socket: Socket) -> None:
        """Set them on a socket before it connects."""
        socket.set(zmq.CURVE_SERVERKEY, self.hub.encode())
        socket.set(zmq.CURVE_PUBLICKEY, self.pair.public.encode())
        socket.set(zmq.CURVE_SECRETKEY, self.pair.secret.encode())


class ConnectionMonitor:
    """Reads how a socket's handshakes end and remembers why the last one failed."""

    def __init__(self, socket: Socket, address: str, keys: Credentials | None) -> None:
        self._socket = socket
        self._address = address
        self._keys = keys
        self._monitor = open_monitor(socket, int(_EVENTS))
        self._broken_off = 0
        self._reconnect_at: float | None = None
        self.connected = False
        """The handshake was done and the connection is open, as of the last `read`."""
        self.lost = False
        """There was a connection, and there is none now."""
        self.refused: KeyRefusedError | None = None
        """Why the hub refuses this connection; None where it does not, or is not there."""

    def read(self) -> bool:
        """Read what happened; True where it is a new refusal."""
        before = str(self.refused)
        while self._monitor.poll(0):
            # As zmq.utils.monitor reads it, which imports asyncio.
            event, value = struct.unpack_from("=Hi", self._monitor.recv_multipart()[0])
            self._note(zmq.Event(event), value)
        if self._reconnect_at is not None and time.monotonic() >= self._reconnect_at:
            self._reconnect()
        return self.refused is not None and str(self.refused) != before

    def check(self) -> None:
        """Raise KeyRefusedError where the hub refuses this connection, and connect anew."""
        self.read()
        if self.refused:
            refused, self.refused = self.refused, None
            self._reconnect()
            raise refused

    def why_not(self) -> str:
        """Say why there is no connection."""
        return str(self.refused or why_absent(socket_file(self._address)))

    def close(self) -> None:
        """Stop reading; to be called before the socket is closed."""
        if not self._socket.closed:
            self._socket.disable_monitor()
        self._monitor.close(linger=0)

    def _note(self, event: zmq.Event, value: int) -> None:
        if event is _E.DISCONNECTED:
            self.connected, self.lost = False, True
            return
        if event is _E.HANDSHAKE_SUCCEEDED:
            self.refused, self._broken_off, self._reconnect_at = None, 0, None
            self.connected, self.lost = True, False
            return
        if event is _E.HANDSHAKE_FAILED_AUTH:
            self.refused = KeyRefusedError(
                f"{self._address}: the hub refuses this key: it is not allowed there for this, or "
                "was revoked")
        elif event is _E.HANDSHAKE_FAILED_PROTOCOL:
            self.refused = self._mismatch()
        else:
            # At a socket file no key is asked for: such a hub has too many connections.
            self._broken_off += (value in (errno.EPIPE, errno.ECONNRESET)
                                 and not self._address.startswith("ipc://"))
            if self._broken_off >= _MIN_BROKEN_OFF:
                self.refused = self._mismatch()
            return
        # libzmq takes these failures for final and would not try again.
        self._reconnect_at = time.monotonic() + _RECONNECT_S

    def _reconnect(self) -> None:
        self._reconnect_at = None
        self._broken_off = 0
        with suppress(zmq.ZMQError):
            self._socket.disconnect(self._address)
        self._socket.connect(self._address)

    def _mismatch(self) -> KeyRefusedError:
        if self._keys is None:
            return KeyRefusedError(
                f"{self._address}: the hub asks for a key there: expected --key and --hub-key")
        return KeyRefusedError(
            f"{self._address}: the handshake fails: --hub-key is not the key of the hub there, it "
            "listens there without keys, or too many are connected")


def connect(
    context: Context, kind: int, address: str, keys: Credentials | None
) -> tuple[Socket, ConnectionMonitor]:
    """Connect a socket to the hub, which may be started later."""
    socket = open_socket(context, kind, address)
    if kind == zmq.DEALER:
        # Nothing is queued while the hub is not there: it would arrive stale.
        socket.set(zmq.IMMEDIATE, 1)
    if keys:
        keys.apply(socket)
    monitor = ConnectionMonitor(socket, address, keys)
    socket.connect(address)
    return socket, monitor


def receive_packet(socket: Socket, flags: int = 0) -> Packet:
    """Receive what the hub sends to a DEALER; RemoteProtocolError where it is malformed.

    The error's `request` is the number of the request that was to be answered, as far as it can be
    read.
    """
    parts = [part.buffer for part in socket.recv_multipart(flags, copy=False)]
    try:
        return decode_from_hub(parts)
    except RemoteProtocolError as error:
        number = readable(parts[0]).get("request")
        error.request = number if isinstance(number, int) else None
        raise
