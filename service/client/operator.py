"""What an operator asks of the hub: dead letters, removal. Needs the role `operator`."""

import time
from collections.abc import Iterator
from datetime import datetime

from denseface.service.client.blocking import Client
from denseface.service.client.exchanges import expect
from denseface.service.errors import UnknownCaptureError
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage, DeadLetter


class Operator(Client):
    """A `Client` that may also remove."""

    def dead(self, *, timeout: float = 5.0) -> Iterator[DeadLetter]:
        """List the captures that were given up and are kept, by sequence number."""
        after = 0
        while True:
            answer = self._send_request(messages.ListDead(
                request=self._exchanges.next_number(), after=after), timeout).message
            letters = expect(answer, messages.DeadLetters).letters
            yield from letters
            if not letters:
                return
            after = letters[-1].sequence

    def retry(self, capture_id: str, *, timeout: float = 5.0) -> None:
        """Try a capture that was given up again, with all its attempts.

        Raises
        ------
        UnknownCaptureError
            The hub has no such capture.
        RequestFailedError
            It is no dead letter, or its frame is damaged.
        """
        answer = self._request_known(messages.RetryDead(
            request=self._exchanges.next_number(), capture_id=capture_id), timeout)
        expect(answer, messages.CapturePending)

    def drop(self, capture_id: str, *, timeout: float = 5.0) -> None:
        """Remove a capture that was given up; raises as `retry`."""
        answer = self._request_known(messages.DropDead(
            request=self._exchanges.next_number(), capture_id=capture_id), timeout)
        expect(answer, messages.Removed)

    def purge(
        self, *, capture_id: str | None = None, before: datetime | None = None,
        everything: bool = False, timeout: float = 30.0,
    ) -> int:
        """Remove captures, whatever became of them, and give their number.

        Parameters
        ----------
        capture_id, before, everything : exactly one: this id; what was accepted before this time,
            with a zone; everything, what is in quarantine included
        timeout : longest time in which nothing is removed, seconds

        Raises
        ------
        RequestFailedError
            The disk refuses, or another program has the hub's database open.
        """
        removed, until = 0, time.monotonic() + timeout
        while True:
            answer = expect(self._send_request(messages.Purge(
                request=self._exchanges.next_number(), capture_id=capture_id, before=before,
                everything=everything), timeout).message, messages.Removed)
            removed += answer.removed
            if not answer.left:
                return removed
            if answer.removed:
                until = time.monotonic() + timeout
            elif time.monotonic() > until:  # what was withdrawn before is being erased
                raise self._no_answer(timeout)

    def _request_known(
        self, message: messages.RetryDead | messages.DropDead, timeout: float
    ) -> BaseMessage:
        answer = self._send_request(message, timeout).message
        if isinstance(answer, messages.CaptureUnknown):
            raise UnknownCaptureError(f"capture {message.capture_id}: the hub has no such capture")
        return answer
