"""A peer with a key of its own that takes the routing ids of others, for as long as it is let."""

import random
import threading
from pathlib import Path
from types import TracebackType
from typing import Self

import zmq

from denseface.service.protocol.roles import Role
from denseface.service.security import allow, new_pair, read_pair, read_public
from tests.ports import free_port

__all__ = ["Thief"]

_AT_ONCE = 8
_WAIT_MS = 200


class Thief:
    """Connects under ids that libzmq gives to others, and notes whatever comes.

    It holds a presser's key and presses nothing, so nothing but its own handshakes is for it.
    """

    def __init__(self, folder: Path, seed: int) -> None:
        self.address = f"tcp://127.0.0.1:{free_port('127.0.0.1')}"
        self.keys = folder / "keys"
        self.tried = 0
        self.stolen: list[str] = []
        _, self._hub = new_pair(self.keys, "hub")
        self._secret, public = new_pair(self.keys, "thief")
        allow(self.keys, "thief", read_public(public), frozenset({Role.PRESSER}))
        self._worker, public = new_pair(self.keys, "worker")
        allow(self.keys, "worker", read_public(public), frozenset({Role.WORKER}))
        self._random = random.Random(seed)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._steal, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._over.set()
        self._thread.join()

    def hub_arguments(self) -> list[str]:
        """Give what makes the hub listen where the thief is."""
        return ["--listen", self.address, "--keys", str(self.keys)]

    def worker_arguments(self) -> list[str]:
        """Give what connects a worker there, for the thief to steal from."""
        return ["--address", self.address, "--key", str(self._worker), "--hub-key", str(self._hub)]

    def _steal(self) -> None:
        pair, hub = read_pair(self._secret), read_public(self._hub)
        with zmq.Context() as context:
            while not self._over.is_set():
                sockets = []
                # libzmq counts up from a number of 32 bits, after a byte of zero.
                first = self._random.randrange(2**32 - _AT_ONCE)
                for number in range(first, first + _AT_ONCE):
                    socket = context.socket(zmq.DEALER)
                    socket.linger = 0
                    socket.curve_serverkey = hub.encode()
                    socket.curve_publickey = pair.public.encode()
                    socket.curve_secretkey = pair.secret.encode()
                    socket.set(zmq.ROUTING_ID, b"\0" + number.to_bytes(4, "big"))
                    socket.connect(self.address)
                    sockets.append(socket)
                    self.tried += 1
                poller = zmq.Poller()
                for socket in sockets:
                    poller.register(socket, zmq.POLLIN)
                for socket, _ in poller.poll(_WAIT_MS):
                    parts = socket.recv_multipart()
                    self.stolen.append(f"the thief received {len(parts)} parts: {parts[0][:200]!r}")
                for socket in sockets:
                    socket.close()
