"""What a client asks the hub and how it takes the answers: no sockets, no waiting.

An exchange is a generator of steps. Each step's result is sent into it, `ClientTimeoutError` is
thrown into it where nothing came in time, and it returns what its caller wants. The clients perform
the steps: `service.client.blocking` by blocking, `service.client.aio` by awaiting.
"""

import itertools
import math
import time
import uuid
from collections.abc import Generator
from dataclasses import dataclass
from datetime import datetime
from typing import Any, TypeVar

from pydantic import ValidationError

from denseface.arguments import describe
from denseface.capture import RgbdFrame
from denseface.recon.face import Consent, Face
from denseface.service import errors
from denseface.service.client.events import PublishedFailure, outcome_of
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseRequest
from denseface.service.protocol.sensor_messages import Gate
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.bounded_dict import BoundedDict

_T = TypeVar("_T")
_Request = TypeVar("_Request", bound=BaseRequest)

_BAD_ID = "capture id {!r}: expected letters, digits, - and _, at most 64"
_UNKNOWN = ("capture {}: the hub has no such capture: it was never accepted, or is no longer kept")
_MAX_WITHDRAWN = 1000
"""Ids that this client withdrew and does not press again."""
_LONGEST_WAIT_S = 20.0
"""Longest time for which the hub is asked to hold an answer back, seconds."""


@dataclass(frozen=True)
class SendRequest:
    """Send a request until it is answered; the result is the answer."""

    message: BaseRequest
    timeout: float
    """Seconds."""


@dataclass(frozen=True)
class AwaitPublication:
    """Wait for a publication, which is the result; None where it is malformed."""

    timeout: float
    """Seconds, may be infinite."""


Step = SendRequest | AwaitPublication
Exchange = Generator[Step, Packet | None, _T]


def send_request(message: BaseRequest, timeout: float) -> Exchange[Packet]:
    """Send a request within an exchange, and give the answer; `timeout` in seconds."""
    packet = yield SendRequest(message, check_seconds(timeout))
    if packet is None:
        raise TypeError("a request is answered by a message")
    return packet


def expect(answer: object, kind: type[_T]) -> _T:
    """Give an answer of the kind expected back; RemoteProtocolError for another."""
    if not isinstance(answer, kind):
        raise errors.RemoteProtocolError(
            f"the hub answered with {type(answer).__name__}, {kind.__name__} expected")
    return answer


def deadline(timeout: float | None) -> float:
    """Give when a time-out is over, seconds of `time.monotonic`; infinite for None."""
    return math.inf if timeout is None else time.monotonic() + check_seconds(timeout)


def check_seconds(timeout: float) -> float:
    """Give a time-out back; LocalProtocolError where it is no number."""
    if not isinstance(timeout, int | float) or math.isnan(timeout):
        raise errors.LocalProtocolError(f"timeout: expected seconds, found {describe(timeout)}")
    return timeout


def check_moment(name: str, given: datetime | None) -> None:
    """Raise LocalProtocolError unless a time is one with a zone, or None."""
    if given is None:
        return
    if not isinstance(given, datetime):
        raise errors.LocalProtocolError(
            f"{name}: expected datetime with a zone, found {describe(given)}")
    if given.utcoffset() is None:
        raise errors.LocalProtocolError(
            f"{name}: {given} has no zone: {name}.astimezone() takes it as of this machine's")


def request_of(kind: type[_Request], **fields: Any) -> _Request:
    """Make a request; LocalProtocolError, of one line, where an argument may not be as it is."""
    try:
        return kind(**fields)
    except ValidationError as error:
        field, why = errors.first_error(error, found=bool(error.errors()[0]["loc"]))
        if field == "capture_id":
            raise errors.LocalProtocolError(_BAD_ID.format(fields[field])) from error
        line = f"{field}: {why}" if field else why.removeprefix("Value error, ")
        raise errors.LocalProtocolError(line) from error


class Exchanges:
    """The exchanges of one client; it numbers their requests."""

    def __init__(self, resend_s: float) -> None:
        self._resend_s = resend_s
        self.next_number = itertools.count(1).__next__
        """Gives the number of the next request."""
        self._withdrawn: BoundedDict[str, None] = BoundedDict(_MAX_WITHDRAWN)

    def press(
        self, capture_id: str | None, timeout: float, *, sensor: str | None, gate: Gate,
        gate_timeout: float, frames: int, consent: Consent | None,
    ) -> Exchange[str]:
        """See `Client.press`."""
        chosen = uuid.uuid4().hex if capture_id is None else capture_id
        message = request_of(
            messages.Press, request=self.next_number(), capture_id=chosen, sensor=sensor,
            gate=gate, gate_timeout=gate_timeout, frames=frames, consent=consent)
        patience = check_seconds(timeout)
        if gate in {"wait", "best"}:
            patience += message.gate_timeout
        answer = (yield from send_request(message, patience)).message
        if isinstance(answer, messages.PressRefused):
            hint = answer.hint
            raise errors.PressRefusedError(
                f"press refused: {answer.message}", answer.reason,
                *((hint.codes, hint.text) if hint else ()))
        expect(answer, messages.PressAccepted)
        return chosen

    def withdraw(self, capture_id: str, timeout: float) -> Exchange[int]:
        """See `Client.withdraw`."""
        message = request_of(
            messages.Withdraw, request=self.next_number(), capture_id=capture_id)
        self._withdrawn[capture_id] = None
        answer = yield from send_request(message, timeout)
        return expect(answer.message, messages.Removed).removed

    def check(self, message: BaseRequest) -> None:
        """Raise PressRefusedError for a press that was withdrawn meanwhile: it is not repeated.

        A hub that was started again since would not know.
        """
        if isinstance(message, messages.Press) and message.capture_id in self._withdrawn:
            raise errors.PressRefusedError("press refused: it was withdrawn", "purged")

    def get(self, capture_id: str, timeout: float) -> Exchange[Face]:
        """See `Client.get`."""
        until = deadline(check_seconds(timeout))
        while True:
            left = until - time.monotonic()
            message = request_of(
                messages.GetFace, request=self.next_number(), capture_id=capture_id,
                wait_s=min(max(left, 0.0), _LONGEST_WAIT_S))
            answer = yield from send_request(message, left + self._resend_s)
            match answer.message:
                case messages.CaptureUnknown():
                    raise errors.UnknownCaptureError(_UNKNOWN.format(capture_id))
                case messages.CapturePending():
                    if time.monotonic() >= until:
                        raise errors.ClientTimeoutError(
                            f"capture {capture_id}: accepted, no face within {timeout:g} s: it is "
                            "pending (does `denseface status` show a worker?)")
                case _:
                    outcome = outcome_of(answer)
                    if isinstance(outcome, PublishedFailure):
                        raise outcome.error
                    return outcome.face

    def get_frame(self, capture_id: str, timeout: float) -> Exchange[RgbdFrame]:
        """See `Client.get_frame`."""
        message = request_of(
            messages.GetFrame, request=self.next_number(), capture_id=capture_id)
        answer = yield from send_request(message, timeout)
        if isinstance(answer.message, messages.CaptureUnknown):
            raise errors.UnknownCaptureError(_UNKNOWN.format(capture_id))
        return expect(answer.message, messages.FrameKept).frame.join(answer.arrays)

    def status(self, timeout: float) -> Exchange[messages.Status]:
        """See `Client.status`."""
        answer = yield from send_request(messages.GetStatus(request=self.next_number()), timeout)
        return expect(answer.message, messages.Status)

    def start(self, last: int | None, since: datetime | None) -> messages.FindStart | None:
        """Give the request that finds where to start; None where neither is given.

        LocalProtocolError where `last` is not positive, `since` has no zone, or both are given.
        """
        if last is None and since is None:
            return None
        check_moment("since", since)
        return request_of(
            messages.FindStart, request=self.next_number(), last=last, since=since)
