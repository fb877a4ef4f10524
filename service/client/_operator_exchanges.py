"""The exchanges of an operator, for both clients."""

import time
from datetime import datetime

from denseface.service.client.exchanges import (
    Exchange,
    Exchanges,
    check_moment,
    check_seconds,
    deadline,
    expect,
    request_of,
    send_request,
)
from denseface.service.errors import ClientTimeoutError, LocalProtocolError, UnknownCaptureError
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage, CaptureSummary, DeadLetter

MOST_CAPTURES = 50
"""Captures in one answer."""


class OperatorExchanges:
    """What an operator asks for, with the numbers of one client's exchanges."""

    def __init__(self, exchanges: Exchanges) -> None:
        self._next_number = exchanges.next_number

    def captures(self, last: int, timeout: float) -> Exchange[tuple[CaptureSummary, ...]]:
        """See `Operator.captures`."""
        if not isinstance(last, int) or not 1 <= last <= MOST_CAPTURES:
            raise LocalProtocolError(f"last: expected 1 to {MOST_CAPTURES}, found {last!r}")
        answer = yield from send_request(
            messages.ListCaptures(request=self._next_number(), last=last), timeout)
        return expect(answer.message, messages.CaptureList).captures

    def dead(self, after: int, timeout: float) -> Exchange[tuple[DeadLetter, ...]]:
        """Give the next dead letters after a sequence number; none where there are no more."""
        answer = yield from send_request(
            messages.ListDead(request=self._next_number(), after=after), timeout)
        return expect(answer.message, messages.DeadLetters).letters

    def retry(self, capture_id: str, timeout: float) -> Exchange[None]:
        """See `Operator.retry`."""
        answer = yield from self._request_known(request_of(
            messages.RetryDead, request=self._next_number(), capture_id=capture_id), timeout)
        expect(answer, messages.CapturePending)

    def drop(self, capture_id: str, timeout: float) -> Exchange[None]:
        """See `Operator.drop`."""
        answer = yield from self._request_known(request_of(
            messages.DropDead, request=self._next_number(), capture_id=capture_id), timeout)
        expect(answer, messages.Removed)

    def purge(
        self, capture_id: str | None, before: datetime | None, everything: bool, timeout: float,
    ) -> Exchange[int]:
        """See `Operator.purge`."""
        check_moment("before", before)
        removed, until = 0, deadline(check_seconds(timeout))
        while True:
            answer = yield from send_request(request_of(
                messages.Purge, request=self._next_number(), capture_id=capture_id, before=before,
                everything=everything), timeout)
            done = expect(answer.message, messages.Removed)
            removed += done.removed
            if not done.left:
                return removed
            if done.removed:
                until = time.monotonic() + timeout
            elif time.monotonic() > until:  # what was withdrawn before is being erased
                raise ClientTimeoutError(f"nothing more was removed within {timeout:g} s")

    def restart_sensor(self, name: str, timeout: float) -> Exchange[None]:
        """See `Operator.restart_sensor`."""
        answer = yield from send_request(request_of(
            messages.RestartSensor, request=self._next_number(), sensor=name), timeout)
        expect(answer.message, messages.SensorRestarting)

    @staticmethod
    def _request_known(
        message: messages.RetryDead | messages.DropDead, timeout: float
    ) -> Exchange[BaseMessage]:
        answer = (yield from send_request(message, timeout)).message
        if isinstance(answer, messages.CaptureUnknown):
            raise UnknownCaptureError(f"capture {message.capture_id}: the hub has no such capture")
        return answer
