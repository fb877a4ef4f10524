"""What other programs import: press, wait for faces, follow what is published.

Every call has a time-out. Requests are repeated until answered, so a hub that restarts meanwhile
is not noticed; repeating is safe, for an id is one capture however often it is pressed.
"""

import itertools
import math
import os
import time
import uuid
from collections.abc import Callable, Iterator
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

import zmq
from pydantic import ValidationError

from recon.face import Face
from service import messages
from service.addresses import publications_of
from service.credentials import Credentials, connect
from service.errors import (
    ClientTimeoutError,
    LocalProtocolError,
    PressRefusedError,
    ProtocolError,
    RemoteProtocolError,
    RequestFailedError,
    UnknownCaptureError,
)
from service.messages import Status
from service.published import Published, PublishedFace, PublishedFailure, Subscriber, outcome_of
from service.settings import ServiceSettings
from service.sockets import send_parts
from service.wire import Packet, decode_from_hub, encode

__all__ = ["Client", "Published", "PublishedFace", "PublishedFailure", "expect"]

_T = TypeVar("_T")

_UNCONNECTED_S = 0.05
"""Time between two tries to send while there is no connection, seconds."""
_LONGEST_WAIT_S = 20.0
"""Longest time for which the hub is asked to hold an answer back, seconds."""


class Client:
    """A connection to the hub; for one thread.

    Parameters
    ----------
    address : the hub's; where None, `DENSEFACE_ADDRESS` or this user's own hub
    key, hub_key : files of one's own secret key and of the hub's public one, for a hub elsewhere;
        where None, `DENSEFACE_KEY` and `DENSEFACE_HUB_KEY`

    Every call raises `KeyRefusedError` where the hub does not let this key in.

    Raises
    ------
    SettingsError
        Where the address is malformed or a key file cannot be used.
    """

    def __init__(
        self, address: str | None = None, *, key: Path | None = None, hub_key: Path | None = None
    ) -> None:
        settings = ServiceSettings.of(os.environ, address=address, key=key, hub_key=hub_key)
        self.address = settings.address
        self._resend_s = settings.resend_s
        self._publications = publications_of(self.address)
        self._keys = Credentials.of(settings)
        self._requests = itertools.count(1)
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket, self._knock = connect(
            self._context, zmq.DEALER, self.address, self._keys)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; harmless when repeated. Ends every iteration over `faces`."""
        self._context.destroy(linger=0)

    def press(self, capture_id: str | None = None, *, timeout: float = 15.0) -> str:
        """Take a frame now; give the capture's id once the frame is safe at the hub.

        Parameters
        ----------
        capture_id : letters, digits, `-`, `_`, at most 64; pressing an id again is the same
            capture; where None, a new one
        timeout : seconds

        Raises
        ------
        PressRefusedError
            There is no such capture and none will appear: no sensor, no frame, no room.
        ClientTimeoutError
            The hub did not answer; press the same id again to be sure.
        LocalProtocolError
            The id is malformed.
        """
        chosen = capture_id or uuid.uuid4().hex
        try:
            message = messages.Press(request=next(self._requests), capture_id=chosen)
        except ValidationError as error:
            raise LocalProtocolError(
                f"capture id {chosen!r}: expected letters, digits, - and _, at most 64") from error
        answer = self._ask(message, timeout).message
        if isinstance(answer, messages.PressRefused):
            raise PressRefusedError(f"press refused: {answer.message}")
        expect(answer, messages.PressAccepted)
        return chosen

    def get(self, capture_id: str, *, timeout: float = 60.0) -> Face:
        """Wait for a capture's face.

        Raises
        ------
        CaptureFailedError
            The capture ended without a face.
        UnknownCaptureError
            The hub has no such capture.
        ClientTimeoutError
            It is not finished in `timeout` seconds.
        """
        deadline = time.monotonic() + timeout
        while True:
            left = deadline - time.monotonic()
            answer = self._ask(messages.GetFace(
                request=next(self._requests), capture_id=capture_id,
                wait_s=min(max(left, 0.0), _LONGEST_WAIT_S)), left + self._resend_s)
            match answer.message:
                case messages.CaptureUnknown():
                    raise UnknownCaptureError(f"capture {capture_id}: the hub has no such capture")
                case messages.CapturePending():
                    if time.monotonic() >= deadline:
                        raise ClientTimeoutError(
                            f"capture {capture_id}: accepted, no face within {timeout:g} s")
                case _:
                    outcome = outcome_of(answer)
                    if isinstance(outcome, PublishedFailure):
                        raise outcome.error
                    return outcome.face

    def faces(
        self, *, after: int | None = None, last: int | None = None, since: datetime | None = None,
        timeout: float | None = None,
    ) -> Iterator[Face]:
        """Follow the faces as they are published; failures are left out. See `published`."""
        for outcome in self.published(after=after, last=last, since=since, timeout=timeout):
            if isinstance(outcome, PublishedFace):
                yield outcome.face

    def published(
        self, *, after: int | None = None, last: int | None = None, since: datetime | None = None,
        timeout: float | None = None,
    ) -> Iterator[Published]:
        """Follow all outcomes that are kept, in order, over restarts of the hub too.

        A number that is left out was removed at the hub. An id that comes again under a higher
        number was made again: the last one stands.

        Parameters
        ----------
        after : sequence number to start after
        last : start with so many of those that are kept
        since : start with what ended at this time, with a zone, or later; of these three at most
            one, and where there is none, only what comes from now on
        timeout : longest wait for the next one, seconds; where None, for ever

        Raises
        ------
        ClientTimeoutError
            Nothing came in `timeout` seconds.
        LocalProtocolError
            More than one start is given, `last` is not positive or `since` has no zone.
        """
        find = self._finder(after, last, since)
        socket, knock = connect(self._context, zmq.SUB, self._publications, self._keys)
        with Subscriber(socket, knock, self._ask_next, self.status) as follow:
            follow.start(after, timeout, find)
            while True:
                yield follow.next(timeout)

    def status(self, *, timeout: float = 5.0) -> Status:
        """Ask who is there and what was done.

        Raises
        ------
        ClientTimeoutError
            The hub did not answer.
        """
        answer = self._ask(messages.GetStatus(request=next(self._requests)), timeout).message
        return expect(answer, Status)

    def _finder(
        self, after: int | None, last: int | None, since: datetime | None
    ) -> Callable[[float], messages.StartAt] | None:
        if (after is not None) + (last is not None) + (since is not None) > 1:
            raise LocalProtocolError("expected at most one of after, last and since")
        if last is None and since is None:
            return None
        try:
            message = messages.FindStart(request=next(self._requests), last=last, since=since)
        except ValidationError as error:
            raise LocalProtocolError(
                f"expected a positive last, found {last}, or a since with a zone, found {since}"
            ) from error
        return lambda timeout: expect(self._ask(message, timeout).message, messages.StartAt)

    def _ask_next(self, after: int, timeout: float) -> Packet:
        return self._ask(messages.GetNext(request=next(self._requests), after=after), timeout)

    def _ask(self, message: messages.Request, timeout: float) -> Packet:
        """Send until answered."""
        parts = encode(Packet(message))
        deadline = time.monotonic() + timeout
        while (left := deadline - time.monotonic()) > 0:
            self._knock.check()
            wait = self._resend_s if send_parts(self._socket, parts) else _UNCONNECTED_S
            answer = self._answer(message.request, min(left, wait))
            if answer is None:
                continue
            if isinstance(answer.message, messages.RequestFailed):
                raise RequestFailedError(f"{self.address}: {answer.message.message}")
            return answer
        why = ("is it running, or was this key revoked?" if self._keys
               else "is `denseface up` running?")
        raise ClientTimeoutError(
            f"{self.address}: no answer from the hub within {timeout:g} s, {why}")

    def _answer(self, request: int, wait: float) -> Packet | None:
        until = time.monotonic() + wait
        while True:
            left = until - time.monotonic()
            if not self._socket.poll(max(0, math.ceil(left * 1000))):
                return None
            try:
                packet = decode_from_hub(self._socket.recv_multipart())
            except ProtocolError:
                continue
            if getattr(packet.message, "request", None) == request:
                return packet


def expect(answer: object, kind: type[_T]) -> _T:
    """Give an answer that is of the kind expected; else RemoteProtocolError."""
    if not isinstance(answer, kind):
        raise RemoteProtocolError(
            f"the hub answered with {type(answer).__name__}, {kind.__name__} expected")
    return answer
