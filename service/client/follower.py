"""Following the hub's publications without a gap: no sockets, no waiting."""

import time
from contextlib import suppress
from datetime import datetime

from denseface.service.client.events import Published, outcome_of
from denseface.service.client.exchanges import (
    AwaitPublication,
    Exchange,
    Exchanges,
    deadline,
    send_request,
)
from denseface.service.errors import ClientTimeoutError, LocalProtocolError, RemoteProtocolError
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseRequest
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet

TOPICS = (Topic.FACES, Topic.STATUS)
"""Topics to subscribe to."""
_REQUEST_TIMEOUT_S = 5.0
"""Time-out of one request, seconds: the hub may be restarting."""
_OPENING_S = 0.25
"""Time between two looks at a hub that reads its data folder, seconds."""


class Follower:
    """Gives publications in order, and requests those that were missed.

    A skipped number, a status with a higher number and a new epoch each tell of missed ones. Where
    to start, and LocalProtocolError where that cannot be, are as in `Client.published`.
    """

    def __init__(
        self, exchanges: Exchanges, after: int | None = None, last: int | None = None,
        since: datetime | None = None,
    ) -> None:
        if (after is not None) + (last is not None) + (since is not None) > 1:
            raise LocalProtocolError("expected at most one of after, last and since")
        if after is not None and (not isinstance(after, int) or after < 0):
            raise LocalProtocolError(
                f"after: expected a sequence number, 0 or more, found {after!r}")
        self._exchanges = exchanges
        self._after = after
        self._start_request = exchanges.start(last, since)
        self._epoch: str | None = None
        self._last = 0
        """Sequence number of the last outcome given."""
        self._behind = True
        """Whether outcomes may have been missed."""

    def start(self, timeout: float | None) -> Exchange[None]:
        """Find where to start; to be run once, after subscribing."""
        until = deadline(timeout)
        while True:
            message = self._start_request or messages.GetStatus(
                request=self._exchanges.next_number())
            found = (yield from self._request_until(message, until)).message
            if not isinstance(found, messages.Status) or found.state == "serving":
                break
            # It does not know its epoch yet. No publication comes before it does.
            if time.monotonic() >= until:
                raise ClientTimeoutError(
                    f"the hub has not yet read its data folder ({found.files_read} of "
                    f"{found.files_to_read} files)")
            with suppress(ClientTimeoutError):
                yield AwaitPublication(min(_OPENING_S, until - time.monotonic()))
        if not isinstance(found, messages.StartAt if self._start_request else messages.Status):
            raise RemoteProtocolError(f"the hub answered with {found.kind} to {message.kind}")
        self._epoch = found.epoch
        self._last = found.sequence if self._after is None else self._after

    def next(self, timeout: float | None) -> Exchange[Published]:
        """Wait for the next publication."""
        until = deadline(timeout)
        while True:
            packet = yield from (
                self._fetch(until) if self._behind else self._await_publication(until))
            if packet is not None:
                outcome = outcome_of(packet)
                self._last = outcome.sequence
                return outcome

    def _fetch(self, until: float) -> Exchange[Packet | None]:
        packet = yield from self._request_until(
            messages.GetNext(request=self._exchanges.next_number(), after=self._last), until)
        message = packet.message
        if not isinstance(
                message, messages.FaceDone | messages.CaptureFailed | messages.NothingNewer):
            raise RemoteProtocolError(f"the hub answered with {message.kind} to get_next")
        if self._new_epoch(message.epoch):
            return None
        if isinstance(message, messages.NothingNewer):
            # Numbers up to this one that did not come have been removed.
            self._last = max(self._last, message.sequence)
            self._behind = False
            return None
        return packet

    def _await_publication(self, until: float) -> Exchange[Packet | None]:
        packet = yield AwaitPublication(until - time.monotonic())
        if packet is None:
            self._behind = True
            return None
        message = packet.message
        if isinstance(message, messages.Status):
            self._behind = self._new_epoch(message.epoch) or message.sequence > self._last
        elif isinstance(message, messages.FaceDone | messages.CaptureFailed):
            if self._new_epoch(message.epoch) or message.sequence > self._last + 1:
                self._behind = True
            elif message.sequence == self._last + 1:
                return packet
        return None

    def _new_epoch(self, epoch: str) -> bool:
        """Start over where the hub has another store: everything in it is new."""
        if epoch == self._epoch:
            return False
        self._epoch, self._last, self._behind = epoch, 0, True
        return True

    def _request_until(self, message: BaseRequest, until: float) -> Exchange[Packet]:
        while True:
            try:
                return (yield from send_request(
                    message, min(_REQUEST_TIMEOUT_S, until - time.monotonic())))
            except ClientTimeoutError:
                if time.monotonic() >= until:
                    raise
