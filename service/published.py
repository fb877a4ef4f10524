"""Following the hub's publications without missing one."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from types import TracebackType
from typing import Protocol, Self, TypeVar

import zmq

from recon.face import Face
from service.credentials import Knock
from service.errors import (
    CaptureFailedError,
    ClientTimeoutError,
    ProtocolError,
    RemoteProtocolError,
)
from service.messages import CaptureFailed, FaceDone, NothingNewer, StartAt, Status
from service.outputs import Topic
from service.wire import Packet, decode_from_hub

__all__ = ["Published", "PublishedFace", "PublishedFailure", "Subscriber", "outcome_of"]

_T = TypeVar("_T")

_PATIENCE_S = 5.0
"""Longest wait for one answer of a hub that may be restarting, seconds."""


_LOOK_S = 1.0
"""Time between two looks whether the hub still lets us in, seconds."""


@dataclass(frozen=True)
class PublishedFace:
    """A finished capture."""

    epoch: str
    sequence: int
    capture_id: str
    face: Face


@dataclass(frozen=True)
class PublishedFailure:
    """A capture that ended without a face."""

    epoch: str
    sequence: int
    capture_id: str
    error: CaptureFailedError


Published = PublishedFace | PublishedFailure


def outcome_of(packet: Packet) -> Published:
    """Read `FaceDone` or `CaptureFailed`.

    Raises
    ------
    RemoteProtocolError
        Where it is neither, or the face is malformed.
    """
    match packet.message:
        case FaceDone(epoch=epoch, sequence=sequence, capture_id=capture_id, face=header):
            return PublishedFace(epoch, sequence, capture_id, header.join(packet.arrays))
        case CaptureFailed(epoch=epoch, sequence=sequence, capture_id=capture_id) as failed:
            return PublishedFailure(epoch, sequence, capture_id, CaptureFailedError(
                capture_id, failed.error, failed.message, dead=failed.dead))
        case other:
            raise RemoteProtocolError(f"the hub answered with {other.kind}, an outcome expected")


class _AskStatus(Protocol):
    def __call__(self, *, timeout: float) -> Status: ...


class Subscriber:
    """Publications in order: what did not come by itself is asked for.

    A number that is skipped, a status that knows a higher number and a new epoch each say that
    something was missed.

    Parameters
    ----------
    socket, knock : a SUB connected to the publications
    ask_next : gives the answer to `GetNext` for a sequence number, in at most some seconds
    """

    def __init__(
        self, socket: "zmq.Socket[bytes]", knock: Knock,
        ask_next: Callable[[int, float], Packet], ask_status: _AskStatus,
    ) -> None:
        self._ask_next = ask_next
        self._ask_status = ask_status
        self._socket = socket
        self._knock = knock
        for topic in (Topic.FACES, Topic.STATUS):
            self._socket.subscribe(topic)
        self._epoch: str | None = None
        self._last = 0
        self._behind = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._knock.close()
        self._socket.close(linger=0)

    def start(
        self, after: int | None, timeout: float | None,
        find: Callable[[float], StartAt] | None = None,
    ) -> None:
        """Start after a number, where `find` says, or at what comes from now on."""
        deadline = _deadline(timeout)
        found: Status | StartAt
        if find is not None:
            found = self._patiently(find, deadline)
        else:
            found = self._patiently(lambda wait: self._ask_status(timeout=wait), deadline)
        self._epoch = found.epoch
        self._last = found.sequence if after is None else after

    def next(self, timeout: float | None) -> Published:
        """Wait for the next one."""
        deadline = _deadline(timeout)
        while True:
            packet = self._fetch(deadline) if self._behind else self._receive(deadline)
            if packet is not None:
                outcome = outcome_of(packet)
                self._last = outcome.sequence
                return outcome

    def _fetch(self, deadline: float) -> Packet | None:
        packet = self._patiently(lambda wait: self._ask_next(self._last, wait), deadline)
        message = packet.message
        if not isinstance(message, FaceDone | CaptureFailed | NothingNewer):
            raise RemoteProtocolError(f"the hub answered with {message.kind} to get_next")
        if self._new_epoch(message.epoch):
            return None
        if isinstance(message, NothingNewer):
            # Numbers up to this one that did not come were removed.
            self._last = max(self._last, message.sequence)
            self._behind = False
            return None
        return packet

    def _receive(self, deadline: float) -> Packet | None:
        while not self._socket.poll(
                max(0, math.ceil(min(deadline - time.monotonic(), _LOOK_S) * 1000))):
            self._knock.check()
            if time.monotonic() >= deadline:
                raise ClientTimeoutError("nothing was published in the time allowed")
        _, *parts = self._socket.recv_multipart()
        try:
            packet = decode_from_hub(parts)
        except ProtocolError:
            self._behind = True
            return None
        message = packet.message
        if isinstance(message, Status):
            self._behind = self._new_epoch(message.epoch) or message.sequence > self._last
        elif isinstance(message, FaceDone | CaptureFailed):
            if self._new_epoch(message.epoch) or message.sequence > self._last + 1:
                self._behind = True
            elif message.sequence == self._last + 1:
                return packet
        return None

    def _new_epoch(self, epoch: str) -> bool:
        """Start over where the hub has another store: all in it is new."""
        if epoch == self._epoch:
            return False
        self._epoch, self._last, self._behind = epoch, 0, True
        return True

    def _patiently(self, ask: Callable[[float], _T], deadline: float) -> _T:
        while True:
            try:
                return ask(min(_PATIENCE_S, deadline - time.monotonic()))
            except ClientTimeoutError:
                if time.monotonic() >= deadline:
                    raise


def _deadline(timeout: float | None) -> float:
    return math.inf if timeout is None else time.monotonic() + timeout
