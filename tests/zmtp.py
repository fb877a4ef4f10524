"""A subscriber that speaks ZMTP 3.0 over a plain socket: it may say what libzmq would not."""

import socket
from pathlib import Path

_GREETING = b"\xff" + bytes(8) + b"\x7f\x03\x00" + b"NULL".ljust(20, b"\0") + bytes(32)
_READY = b"\x05READY\x0bSocket-Type\x00\x00\x00\x03SUB"
_MORE = 1


class RawSubscriber:
    """Connects without a key to the publications of a hub."""

    def __init__(self, path: Path, limit_s: float) -> None:
        self.socket = socket.socket(socket.AF_UNIX)
        self.socket.settimeout(limit_s)
        self.socket.connect(str(path))
        self.socket.sendall(_GREETING)
        self._receive(64)
        self.socket.sendall(b"\x04" + bytes([len(_READY)]) + _READY)
        _, size = self._receive(2)
        self._receive(size)

    def send(self, frame: bytes, *, more: bool = False) -> None:
        """Send one frame."""
        self.socket.sendall(bytes([_MORE if more else 0, len(frame)]) + frame)

    def close(self) -> None:
        """Leave."""
        self.socket.close()

    def ended(self) -> bool:
        """Wait until the hub hangs up, and pass over what it publishes until then."""
        try:
            while self.socket.recv(65536):
                pass
        except ConnectionResetError:
            pass
        return True

    def _receive(self, size: int) -> bytes:
        data = b""
        while len(data) < size:
            part = self.socket.recv(size - len(data))
            assert part, "the hub hangs up"
            data += part
        return data
