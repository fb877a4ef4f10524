"""What both clients open; waiting is left to them."""

import os
from collections.abc import Callable, Sequence
from pathlib import Path

import zmq

from denseface.service.client._hub_wait import HubWait
from denseface.service.client.exchanges import Exchanges, check_seconds
from denseface.service.errors import (
    ClientClosedError,
    ClientForkedError,
    ClientTimeoutError,
    RemoteProtocolError,
    RequestFailedError,
)
from denseface.service.protocol.messages import RequestFailed
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Buffer, Packet
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_connectable, publications_of
from denseface.service.transport.connection import Credentials, connect
from denseface.service.transport.sockets import Context, send_parts
from denseface.service.transport.subscription import Subscription

_SEND_RETRY_S = 0.05
"""Time between two tries to send while there is no connection, seconds."""


class BaseClient:
    """The socket for requests, and how subscriptions are opened; see `Client`."""

    def __init__(
        self, address: str | None = None, *, key: str | Path | None = None,
        hub_key: str | Path | None = None,
        connect_timeout: float | None = None, on_waiting: Callable[[str], None] | None = None,
    ) -> None:
        settings = ServiceSettings.of(os.environ, address=address, key=key, hub_key=hub_key)
        if connect_timeout is not None:
            check_seconds(connect_timeout)
        self._process = os.getpid()
        self.address = settings.address
        self._resend_s = settings.resend_s
        check_connectable(self.address)
        self._publications = publications_of(self.address)
        self._keys = Credentials.of(settings)
        self._exchanges = Exchanges(settings.resend_s)
        self._hub_wait = HubWait(self.address, connect_timeout, on_waiting)
        self._context: Context = zmq.Context()
        self._socket, self._monitor = connect(self._context, zmq.DEALER, self.address, self._keys)

    def _forked(self) -> bool:
        """Say whether this process was forked after the client was made.

        It has none of the threads that move the messages, so its calls would wait for ever; and it
        shares descriptors with the process where they are: it must not touch the sockets.
        """
        return self._process != os.getpid()

    def _check_process(self) -> None:
        if self._forked():
            raise ClientForkedError(
                f"{self.address}: the client was made before this process was forked: make a new "
                "one here")

    def _check_open(self) -> None:
        self._check_process()
        if self._context.closed:
            raise self._closed()

    def _closed(self) -> ClientClosedError:
        return ClientClosedError(f"{self.address}: the client was closed")

    def _subscribe(self, *topics: Topic) -> Subscription:
        self._check_open()
        return Subscription(self._context, self._publications, self._keys, topics)

    def _send(self, parts: Sequence[Buffer], subscription: Subscription | None) -> float:
        """Send a request, and give how long to wait for its answer until the next try, seconds.

        KeyRefusedError where the hub refuses this key, for the subscription too: a key that was
        revoked gets no answer. ClientTimeoutError where a first connection takes too long.
        """
        self._check_process()
        self._monitor.check()
        if subscription:
            subscription.monitor.check()
        if send_parts(self._socket, parts):
            self._hub_wait.end()
            return self._resend_s
        self._hub_wait.look(self._monitor)
        return _SEND_RETRY_S

    def _check_subscription(self, subscription: Subscription) -> None:
        """Look how a subscription's connection is while nothing comes; raises as `_send`."""
        subscription.monitor.check()
        self._hub_wait.look(subscription.monitor)

    def _checked(self, answer: Packet) -> Packet:
        """Give an answer back, unless the hub says that it cannot answer: RequestFailedError."""
        if isinstance(answer.message, RequestFailed):
            raise RequestFailedError(f"{self.address}: {answer.message.message}")
        return answer

    def _unreadable(self, error: RemoteProtocolError) -> RemoteProtocolError:
        return RemoteProtocolError(
            f"{self.address}: the hub's answer cannot be read: {error}", error.reason)

    @staticmethod
    def _nothing_published(subscription: Subscription) -> ClientTimeoutError:
        monitor = subscription.monitor
        why = "" if monitor.connected else f": {monitor.why_not()}"
        return ClientTimeoutError(f"nothing was published in the time allowed{why}")

    def _no_answer(self, timeout: float) -> ClientTimeoutError:
        self._monitor.read()
        why = self._monitor.why_not() if not self._monitor.connected else (
            "it is there, and busy, or stopped"
            + (", or this key was revoked" if self._keys else ""))
        return ClientTimeoutError(
            f"{self.address}: no answer from the hub within {timeout:g} s: {why}")
