"""What other programs import: press, wait for faces, follow what is published.

Every call has a time-out. Requests are repeated until answered, so a hub that restarts meanwhile
is not noticed; repeating is safe, for an id is one capture however often it is pressed.
"""

import math
import os
import time
from collections.abc import Iterator
from contextlib import closing
from datetime import datetime
from pathlib import Path
from typing import TypeVar

import zmq

from denseface.recon.face import Face
from denseface.service.client.events import (
    Published,
    PublishedFace,
    PublishedFailure,
    PublishedPreview,
    preview_of,
)
from denseface.service.client.exchanges import (
    SEND_RETRY_S,
    Exchange,
    Exchanges,
    SendRequest,
    Step,
    deadline,
    no_answer,
    raise_if_failed,
)
from denseface.service.client.follower import TOPICS, Follower
from denseface.service.errors import ClientClosedError, ClientTimeoutError, ProtocolError
from denseface.service.protocol import messages
from denseface.service.protocol.messages import Status
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet, decode_from_hub, encode
from denseface.service.runtime.closing import Closing
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_connectable, publications_of
from denseface.service.transport.connection import Credentials, connect
from denseface.service.transport.sockets import send_parts
from denseface.service.transport.subscription import CHECK_INTERVAL_S, Subscription

__all__ = ["Client", "Published", "PublishedFace", "PublishedFailure", "PublishedPreview"]

_T = TypeVar("_T")


class Client(Closing):
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
        Where the address is malformed, the folder of the default one is someone else's, or a key
        file cannot be used.
    """

    def __init__(
        self, address: str | None = None, *, key: Path | None = None, hub_key: Path | None = None
    ) -> None:
        settings = ServiceSettings.of(os.environ, address=address, key=key, hub_key=hub_key)
        self.address = settings.address
        self._resend_s = settings.resend_s
        check_connectable(self.address)
        self._publications = publications_of(self.address)
        self._keys = Credentials.of(settings)
        self._exchanges = Exchanges(settings.resend_s)
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket, self._monitor = connect(
            self._context, zmq.DEALER, self.address, self._keys)

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
        return self._run(self._exchanges.press(capture_id, timeout))

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
        return self._run(self._exchanges.get(capture_id, timeout))

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
        follower = Follower(self._exchanges, after, last, since)
        with closing(Subscription(
                self._context, self._publications, self._keys, TOPICS)) as subscription:
            self._run(follower.start(timeout), subscription)
            while True:
                yield self._run(follower.next(timeout), subscription)

    def previews(self, *, timeout: float | None = None) -> Iterator[PublishedPreview]:
        """Follow what the sensor sees, ten times a second at most: always the newest.

        Nothing is kept of them: what does not come in time is skipped. A live sensor shows its
        newest picture, a recording the one that the next press gives.

        Parameters
        ----------
        timeout : longest wait for the next one, seconds; where None, for ever

        Raises
        ------
        ClientTimeoutError
            Nothing came in `timeout` seconds.
        """
        with closing(Subscription(
                self._context, self._publications, self._keys, (Topic.PREVIEW,))) as subscription:
            while True:
                until = deadline(timeout)
                preview = None
                while preview is None:
                    self._wait(subscription, until - time.monotonic())
                    preview = preview_of(subscription.receive_latest())
                yield preview

    def status(self, *, timeout: float = 5.0) -> Status:
        """Ask who is there and what was done.

        Raises
        ------
        ClientTimeoutError
            The hub did not answer.
        """
        return self._run(self._exchanges.status(timeout))

    def _run(self, exchange: Exchange[_T], subscription: Subscription | None = None) -> _T:
        try:
            step = next(exchange)
            while True:
                try:
                    came = self._perform(step, subscription)
                except ClientTimeoutError as error:
                    step = exchange.throw(error)
                else:
                    step = exchange.send(came)
        except StopIteration as end:
            result: _T = end.value
            return result

    def _perform(self, step: Step, subscription: Subscription | None) -> Packet | None:
        if isinstance(step, SendRequest):
            return self._send_request(step.message, step.timeout, subscription)
        if subscription is None:
            raise TypeError("there is no subscription to hear")
        self._wait(subscription, step.timeout)
        return subscription.receive()

    @staticmethod
    def _wait(subscription: Subscription, timeout: float) -> None:
        until = time.monotonic() + timeout
        while not subscription.socket.poll(
                max(0, math.ceil(min(until - time.monotonic(), CHECK_INTERVAL_S) * 1000))):
            subscription.monitor.check()
            if time.monotonic() >= until:
                raise ClientTimeoutError("nothing was published in the time allowed")

    def _send_request(
        self, message: messages.Request, timeout: float, subscription: Subscription | None = None
    ) -> Packet:
        """Send until answered, or until it is known that the hub lets us in no more."""
        if self._context.closed:
            raise ClientClosedError(f"{self.address}: the client was closed")
        parts = encode(Packet(message))
        until = time.monotonic() + timeout
        while (left := until - time.monotonic()) > 0:
            self._monitor.check()
            if subscription:  # a key revoked meanwhile is cut off there, and not answered here
                subscription.monitor.check()
            wait = self._resend_s if send_parts(self._socket, parts) else SEND_RETRY_S
            answer = self._answer(message.request, min(left, wait))
            if answer is None:
                continue
            return raise_if_failed(self.address, answer)
        raise no_answer(self.address, timeout, keys=self._keys is not None)

    def _answer(self, request: int, wait: float) -> Packet | None:
        until = time.monotonic() + wait
        while True:
            left = until - time.monotonic()
            if not self._socket.poll(max(0, math.ceil(left * 1000))):
                return None
            try:
                packet = decode_from_hub(
                    [part.buffer for part in self._socket.recv_multipart(copy=False)])
            except ProtocolError:
                continue
            if getattr(packet.message, "request", None) == request:
                return packet

