"""The hub's process: the only one that binds. Sockets here, decisions in `service.hub`."""

import math
import time

import structlog
import zmq

from recon.settings import Settings
from service.addresses import check_bindable, publications_of, socket_file
from service.errors import AddressError, ProtocolError
from service.hub import Hub
from service.outputs import Output, Publish
from service.settings import ServiceSettings
from service.sockets import open_socket, send_parts
from service.stopping import StopSignal
from service.store import FolderStore
from service.wire import decode_to_hub, encode

__all__ = ["run"]

_TICK_S = 0.25
_BURST = 32
"""Messages taken between two looks at the clock."""


def run(settings: ServiceSettings, recon: Settings) -> int:
    """Serve until SIGINT or SIGTERM and give the exit status.

    Raises
    ------
    AddressError, HubRunningError, StoreError
        Where the address or the data folder cannot be had.
    """
    log = structlog.get_logger("hub")
    with StopSignal() as stop, FolderStore(settings.data) as store, zmq.Context() as context:
        loop = _Loop(context, settings.address, Hub(store, settings, recon))
        log.info("listening", address=settings.address, data=str(settings.data))
        try:
            loop.serve(stop)
        finally:
            loop.close()
        log.info("stopped")
        return stop.exit_status


class _Loop:
    def __init__(
        self, context: "zmq.Context[zmq.Socket[bytes]]", address: str, hub: Hub
    ) -> None:
        check_bindable(address)
        self._addresses = (address, publications_of(address))
        self._hub = hub
        self._log = structlog.get_logger("hub")
        self._router = open_socket(context, zmq.ROUTER)
        self._router.set(zmq.ROUTER_MANDATORY, 1)
        self._publisher = open_socket(context, zmq.XPUB)
        for socket, one in zip((self._router, self._publisher), self._addresses, strict=True):
            try:
                socket.bind(one)
            except zmq.ZMQError as error:
                self.close()
                raise AddressError(f"{one}: {error.strerror}") from error

    def close(self) -> None:
        self._router.close()
        self._publisher.close()
        for address in self._addresses:
            if path := socket_file(address):
                path.unlink(missing_ok=True)

    def serve(self, stop: StopSignal) -> None:
        poller = zmq.Poller()
        for one in (self._router, self._publisher, stop):
            poller.register(one, zmq.POLLIN)
        due = 0.0
        while not stop:
            if (now := time.monotonic()) >= due:
                due = now + _TICK_S
                self._give_out(self._hub.tick(now))
            ready = dict(poller.poll(max(0, math.ceil((due - now) * 1000))))
            if self._router in ready:
                self._take_in()
            if self._publisher in ready:
                self._publisher.recv_multipart()  # who subscribes to what is of no interest
            if stop.fileno() in ready:
                stop.drain()

    def _take_in(self) -> None:
        for _ in range(_BURST):
            try:
                peer, *parts = self._router.recv_multipart(zmq.DONTWAIT)
            except zmq.Again:
                return
            try:
                packet = decode_to_hub(parts)
            except ProtocolError as error:
                self._log.warning("message dropped", peer=peer.hex(), reason=str(error))
                continue
            self._give_out(self._hub.receive(time.monotonic(), peer, packet))

    def _give_out(self, outputs: list[Output]) -> None:
        for output in outputs:
            parts = encode(output.packet)
            if isinstance(output, Publish):
                send_parts(self._publisher, [output.topic.encode(), *parts])
                continue
            try:
                delivered = send_parts(self._router, [output.peer, *parts])
            except zmq.ZMQError as error:
                if error.errno != zmq.EHOSTUNREACH:
                    raise
                delivered = False
            if not delivered:
                self._give_out(self._hub.unreachable(output.peer))
