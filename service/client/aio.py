"""`service.client.blocking` for asyncio: the same calls, awaited.

ZeroMQ's sockets are watched by the event loop through their file descriptors, which say only that
something may have happened; each look takes all there is.
"""

import asyncio
import os
import time
from collections.abc import AsyncIterator
from contextlib import closing, suppress
from datetime import datetime
from pathlib import Path
from types import TracebackType
from typing import Self, TypeVar

import zmq

from denseface.recon.face import Face
from denseface.service.client.events import Published, PublishedFace, PublishedPreview, preview_of
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
from denseface.service.protocol.messages import Request, Status
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet, decode_from_hub, encode
from denseface.service.settings import ServiceSettings
from denseface.service.transport.addresses import check_connectable, publications_of
from denseface.service.transport.connection import Credentials, connect
from denseface.service.transport.sockets import send_parts
from denseface.service.transport.subscription import CHECK_INTERVAL_S, Subscription

__all__ = ["AsyncClient"]

_T = TypeVar("_T")


class AsyncClient:
    """A connection to the hub; for one event loop, whose tasks may share it.

    Parameters and errors are those of `service.client.blocking.Client`. A call that is cancelled is
    forgotten; what it asked for may happen all the same.
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
        self._pending: dict[int, asyncio.Future[Packet]] = {}
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket, self._monitor = connect(self._context, zmq.DEALER, self.address, self._keys)
        self._loop: asyncio.AbstractEventLoop | None = None
        self._readable_events: dict[int, asyncio.Event] = {}
        """Wakes who waits for a subscription, by the socket's descriptor."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; harmless when repeated. Ends every iteration and every call under way."""
        self._unwatch()
        for waiting in self._pending.values():
            if not waiting.done():
                waiting.set_exception(
                    ClientClosedError(f"{self.address}: the client was closed"))
        while self._readable_events:
            descriptor, readable = self._readable_events.popitem()
            asyncio.get_running_loop().remove_reader(descriptor)
            readable.set()
        self._context.destroy(linger=0)

    async def press(self, capture_id: str | None = None, *, timeout: float = 15.0) -> str:
        """Take a frame now; see `Client.press`."""
        return await self._run(self._exchanges.press(capture_id, timeout))

    async def get(self, capture_id: str, *, timeout: float = 60.0) -> Face:
        """Wait for a capture's face; see `Client.get`."""
        return await self._run(self._exchanges.get(capture_id, timeout))

    async def status(self, *, timeout: float = 5.0) -> Status:
        """Ask who is there and what was done; see `Client.status`."""
        return await self._run(self._exchanges.status(timeout))

    async def faces(
        self, *, after: int | None = None, last: int | None = None, since: datetime | None = None,
        timeout: float | None = None,
    ) -> AsyncIterator[Face]:
        """Follow the faces as they are published; see `Client.faces`."""
        async for outcome in self.published(after=after, last=last, since=since, timeout=timeout):
            if isinstance(outcome, PublishedFace):
                yield outcome.face

    async def published(
        self, *, after: int | None = None, last: int | None = None, since: datetime | None = None,
        timeout: float | None = None,
    ) -> AsyncIterator[Published]:
        """Follow all outcomes that are kept, in order; see `Client.published`."""
        follower = Follower(self._exchanges, after, last, since)
        with suppress(ClientClosedError), closing(self._subscribe(*TOPICS)) as subscription:
            await self._run(follower.start(timeout), subscription)
            while True:
                yield await self._run(follower.next(timeout), subscription)

    async def previews(self, *, timeout: float | None = None) -> AsyncIterator[PublishedPreview]:
        """Follow what the sensor sees, always the newest; see `Client.previews`."""
        with suppress(ClientClosedError), closing(self._subscribe(Topic.PREVIEW)) as subscription:
            while True:
                until = deadline(timeout)
                preview = None
                while preview is None:
                    await self._wait(subscription, until - time.monotonic())
                    preview = preview_of(subscription.receive_latest())
                yield preview

    def _subscribe(self, *topics: Topic) -> Subscription:
        self._check_open()
        return Subscription(self._context, self._publications, self._keys, topics)

    async def _run(self, exchange: Exchange[_T], subscription: Subscription | None = None) -> _T:
        try:
            step = next(exchange)
            while True:
                try:
                    came = await self._perform(step, subscription)
                except ClientTimeoutError as error:
                    step = exchange.throw(error)
                else:
                    step = exchange.send(came)
        except StopIteration as end:
            result: _T = end.value
            return result
        finally:
            exchange.close()

    async def _perform(self, step: Step, subscription: Subscription | None) -> Packet | None:
        if isinstance(step, SendRequest):
            return await self._send_request(step.message, step.timeout, subscription)
        if subscription is None:
            raise TypeError("there is no subscription to hear")
        await self._wait(subscription, step.timeout)
        return subscription.receive()

    async def _send_request(
        self, message: Request, timeout: float, subscription: Subscription | None = None
    ) -> Packet:
        """Send until answered, or until it is known that the hub lets us in no more."""
        self._check_open()
        parts = encode(Packet(message))
        answer = self._pending[message.request] = asyncio.get_running_loop().create_future()
        until = time.monotonic() + timeout
        try:
            while (left := until - time.monotonic()) > 0:
                self._monitor.check()
                if subscription:  # a key revoked meanwhile is cut off there, and not answered here
                    subscription.monitor.check()
                wait = self._resend_s if send_parts(self._socket, parts) else SEND_RETRY_S
                self._watch()
                await asyncio.wait([answer], timeout=min(left, wait))
                if answer.done():
                    return raise_if_failed(self.address, answer.result())
        finally:
            del self._pending[message.request]
            if not answer.cancel() and not answer.cancelled():
                answer.exception()  # seen, where the call was cancelled meanwhile
            if not self._pending:
                self._unwatch()
        raise no_answer(self.address, timeout, keys=self._keys is not None)

    def _watch(self) -> None:
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
            self._loop.add_reader(self._socket.fileno(), self._take_answers)
        self._take_answers()  # sending may have used up the descriptor's sign

    def _unwatch(self) -> None:
        if self._loop is not None:
            self._loop.remove_reader(self._socket.fileno())
            self._loop = None

    def _take_answers(self) -> None:
        while True:
            try:
                packet = decode_from_hub([part.buffer for part in self._socket.recv_multipart(
                    zmq.DONTWAIT, copy=False)])
            except zmq.Again:
                return
            except ProtocolError:
                continue
            answer = self._pending.get(getattr(packet.message, "request", 0))
            if answer is not None and not answer.done():
                answer.set_result(packet)

    def _check_open(self) -> None:
        if self._context.closed:
            raise ClientClosedError(f"{self.address}: the client was closed")

    async def _wait(self, subscription: Subscription, timeout: float) -> None:
        until = time.monotonic() + timeout
        while not await self._readable(
                subscription.socket, min(until - time.monotonic(), CHECK_INTERVAL_S)):
            subscription.monitor.check()
            if time.monotonic() >= until:
                raise ClientTimeoutError("nothing was published in the time allowed")

    async def _readable(self, socket: "zmq.Socket[bytes]", seconds: float) -> bool:
        """Wait until there is something to receive; False where there is nothing in this time."""
        loop = asyncio.get_running_loop()
        until = loop.time() + seconds
        while not socket.closed:
            if socket.poll(0):
                return True
            left = until - loop.time()
            if left <= 0:
                return False
            descriptor = socket.fileno()
            readable = self._readable_events[descriptor] = asyncio.Event()
            loop.add_reader(descriptor, readable.set)
            try:
                await asyncio.wait_for(readable.wait(), left)
            except TimeoutError:
                continue
            finally:
                if self._readable_events.pop(descriptor, None):  # else it may be another's by now
                    loop.remove_reader(descriptor)
        raise ClientClosedError(f"{self.address}: the client was closed")
