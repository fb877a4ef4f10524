"""What a client asks the hub and how it takes the answers: no sockets, no waiting.

A talk is a generator. It gives out one step after the other, is sent what came of it, and returns
what its caller wants; where nothing came in the time allowed, `ClientTimeoutError` is thrown into
it. `service.client.blocking` and `service.client.aio` carry the steps out, one by
blocking, one by awaiting.
"""

import itertools
import math
import time
import uuid
from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime
from typing import TypeVar

from pydantic import ValidationError

from denseface.recon.face import Face
from denseface.service.client.events import PublishedFailure, outcome_of
from denseface.service.errors import (
    ClientTimeoutError,
    LocalProtocolError,
    PressRefusedError,
    RemoteProtocolError,
    RequestFailedError,
    UnknownCaptureError,
)
from denseface.service.protocol import messages
from denseface.service.protocol.wire import Packet

__all__ = [
    "SEND_RETRY_S",
    "AwaitPublication",
    "Exchange",
    "Exchanges",
    "SendRequest",
    "Step",
    "deadline",
    "expect",
    "no_answer",
    "raise_if_failed",
    "send_request",
]

_T = TypeVar("_T")

SEND_RETRY_S = 0.05
"""Time between two tries to send while there is no connection, seconds."""
_LONGEST_WAIT_S = 20.0
"""Longest time for which the hub is asked to hold an answer back, seconds."""


@dataclass(frozen=True)
class SendRequest:
    """Send a request until it is answered; what comes of it is the answer."""

    message: messages.Request
    timeout: float


@dataclass(frozen=True)
class AwaitPublication:
    """Wait for a publication, without end where `timeout` is infinite; None where it is garbled."""

    timeout: float


Step = SendRequest | AwaitPublication
Exchange = Generator[Step, Packet | None, _T]


def send_request(message: messages.Request, timeout: float) -> Exchange[Packet]:
    """Ask in the midst of a talk."""
    packet = yield SendRequest(message, timeout)
    if packet is None:
        raise TypeError("a request is answered by a message")
    return packet


def raise_if_failed(address: str, answer: Packet) -> Packet:
    """Give an answer back, unless the hub says that it cannot answer.

    Raises
    ------
    RequestFailedError
        It says so.
    """
    if isinstance(answer.message, messages.RequestFailed):
        raise RequestFailedError(f"{address}: {answer.message.message}")
    return answer


def no_answer(address: str, timeout: float, *, keys: bool) -> ClientTimeoutError:
    """Say that the hub does not answer, and where to look."""
    why = "is it running, or was this key revoked?" if keys else "is `denseface up` running?"
    return ClientTimeoutError(f"{address}: no answer from the hub within {timeout:g} s, {why}")


def expect(answer: object, kind: type[_T]) -> _T:
    """Give an answer that is of the kind expected; else RemoteProtocolError."""
    if not isinstance(answer, kind):
        raise RemoteProtocolError(
            f"the hub answered with {type(answer).__name__}, {kind.__name__} expected")
    return answer


def deadline(timeout: float | None) -> float:
    """Give the time of `time.monotonic` at which a time-out is over; None is without end."""
    return math.inf if timeout is None else time.monotonic() + timeout


class Exchanges:
    """The talks of one client; it numbers their requests."""

    def __init__(self, resend_s: float) -> None:
        self._resend_s = resend_s
        self._requests = itertools.count(1)

    def number(self) -> int:
        """Give the number of the next request."""
        return next(self._requests)

    def press(self, capture_id: str | None, timeout: float) -> Exchange[str]:
        """See `Client.press`."""
        chosen = uuid.uuid4().hex if capture_id is None else capture_id
        try:
            message = messages.Press(request=self.number(), capture_id=chosen)
        except ValidationError as error:
            raise LocalProtocolError(
                f"capture id {chosen!r}: expected letters, digits, - and _, at most 64") from error
        answer = (yield from send_request(message, timeout)).message
        if isinstance(answer, messages.PressRefused):
            raise PressRefusedError(f"press refused: {answer.message}", answer.reason)
        expect(answer, messages.PressAccepted)
        return chosen

    def get(self, capture_id: str, timeout: float) -> Exchange[Face]:
        """See `Client.get`."""
        until = time.monotonic() + timeout
        while True:
            left = until - time.monotonic()
            answer = yield from send_request(messages.GetFace(
                request=self.number(), capture_id=capture_id,
                wait_s=min(max(left, 0.0), _LONGEST_WAIT_S)), left + self._resend_s)
            match answer.message:
                case messages.CaptureUnknown():
                    raise UnknownCaptureError(f"capture {capture_id}: the hub has no such capture")
                case messages.CapturePending():
                    if time.monotonic() >= until:
                        raise ClientTimeoutError(
                            f"capture {capture_id}: accepted, no face within {timeout:g} s")
                case _:
                    outcome = outcome_of(answer)
                    if isinstance(outcome, PublishedFailure):
                        raise outcome.error
                    return outcome.face

    def status(self, timeout: float) -> Exchange[messages.Status]:
        """See `Client.status`."""
        answer = yield from send_request(messages.GetStatus(request=self.number()), timeout)
        return expect(answer.message, messages.Status)

    def start(self, last: int | None, since: datetime | None) -> messages.FindStart | None:
        """Give the request that finds where to start; None where neither is given.

        Raises
        ------
        LocalProtocolError
            `last` is not positive, `since` has no zone, or both are given.
        """
        if last is None and since is None:
            return None
        try:
            return messages.FindStart(request=self.number(), last=last, since=since)
        except ValidationError as error:
            raise LocalProtocolError(
                f"expected a positive last, found {last}, or a since with a zone, found {since}"
            ) from error
