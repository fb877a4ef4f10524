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
    UNCONNECTED_S,
    Exchanges,
    SendRequest,
    Step,
    Talk,
    checked,
    deadline,
    no_answer,
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
from denseface.service.transport.subscription import LOOK_S, Subscription

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
        self._talks = Exchanges(settings.resend_s)
        self._waiting: dict[int, asyncio.Future[Packet]] = {}
        self._context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
        self._socket, self._knock = connect(self._context, zmq.DEALER, self.address, self._keys)
        self._watched: asyncio.AbstractEventLoop | None = None
        self._signs: dict[int, asyncio.Event] = {}
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
        for waiting in self._waiting.values():
            if not waiting.done():
                waiting.set_exception(
                    ClientClosedError(f"{self.address}: the client was closed"))
        while self._signs:
            descriptor, sign = self._signs.popitem()
            asyncio.get_running_loop().remove_reader(descriptor)
            sign.set()
        self._context.destroy(linger=0)

    async def press(self, capture_id: str | None = None, *, timeout: float = 15.0) -> str:
        """Take a frame now; see `Client.press`."""
        return await self._carry_out(self._talks.press(capture_id, timeout))

    async def get(self, capture_id: str, *, timeout: float = 60.0) -> Face:
        """Wait for a capture's face; see `Client.get`."""
        return await self._carry_out(self._talks.get(capture_id, timeout))

    async def status(self, *, timeout: float = 5.0) -> Status:
        """Ask who is there and what was done; see `Client.status`."""
        return await self._carry_out(self._talks.status(timeout))

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
        follow = Follower(self._talks, after, last, since)
        with suppress(ClientClosedError), closing(self._ear(*TOPICS)) as ear:
            await self._carry_out(follow.start(timeout), ear)
            while True:
                yield await self._carry_out(follow.next(timeout), ear)

    async def previews(self, *, timeout: float | None = None) -> AsyncIterator[PublishedPreview]:
        """Follow what the sensor sees, always the newest; see `Client.previews`."""
        with suppress(ClientClosedError), closing(self._ear(Topic.PREVIEW)) as ear:
            while True:
                until = deadline(timeout)
                preview = None
                while preview is None:
                    await self._wait(ear, until - time.monotonic())
                    preview = preview_of(ear.newest())
                yield preview

    def _ear(self, *topics: Topic) -> Subscription:
        self._check_open()
        return Subscription(self._context, self._publications, self._keys, topics)

    async def _carry_out(self, talk: Talk[_T], ear: Subscription | None = None) -> _T:
        try:
            step = next(talk)
            while True:
                try:
                    came = await self._do(step, ear)
                except ClientTimeoutError as error:
                    step = talk.throw(error)
                else:
                    step = talk.send(came)
        except StopIteration as end:
            result: _T = end.value
            return result
        finally:
            talk.close()

    async def _do(self, step: Step, ear: Subscription | None) -> Packet | None:
        if isinstance(step, SendRequest):
            return await self._ask(step.message, step.timeout, ear)
        if ear is None:
            raise TypeError("there is no subscription to hear")
        await self._wait(ear, step.timeout)
        return ear.receive()

    async def _ask(
        self, message: Request, timeout: float, ear: Subscription | None = None
    ) -> Packet:
        """Send until answered, or until it is known that the hub lets us in no more."""
        self._check_open()
        parts = encode(Packet(message))
        answer = self._waiting[message.request] = asyncio.get_running_loop().create_future()
        until = time.monotonic() + timeout
        try:
            while (left := until - time.monotonic()) > 0:
                self._knock.check()
                if ear:  # a key revoked meanwhile is cut off there, and not answered here
                    ear.knock.check()
                wait = self._resend_s if send_parts(self._socket, parts) else UNCONNECTED_S
                self._watch()
                await asyncio.wait([answer], timeout=min(left, wait))
                if answer.done():
                    return checked(self.address, answer.result())
        finally:
            del self._waiting[message.request]
            if not answer.cancel() and not answer.cancelled():
                answer.exception()  # seen, where the call was cancelled meanwhile
            if not self._waiting:
                self._unwatch()
        raise no_answer(self.address, timeout, keys=self._keys is not None)

    def _watch(self) -> None:
        if self._watched is None:
            self._watched = asyncio.get_running_loop()
            self._watched.add_reader(self._socket.fileno(), self._take_answers)
        self._take_answers()  # sending may have used up the descriptor's sign

    def _unwatch(self) -> None:
        if self._watched is not None:
            self._watched.remove_reader(self._socket.fileno())
            self._watched = None

    def _take_answers(self) -> None:
        while True:
            try:
                packet = decode_from_hub([part.buffer for part in self._socket.recv_multipart(
                    zmq.DONTWAIT, copy=False)])
            except zmq.Again:
                return
            except ProtocolError:
                continue
            answer = self._waiting.get(getattr(packet.message, "request", 0))
            if answer is not None and not answer.done():
                answer.set_result(packet)

    def _check_open(self) -> None:
        if self._context.closed:
            raise ClientClosedError(f"{self.address}: the client was closed")

    async def _wait(self, ear: Subscription, timeout: float) -> None:
        until = time.monotonic() + timeout
        while not await self._readable(ear.socket, min(until - time.monotonic(), LOOK_S)):
            ear.knock.check()
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
            sign = self._signs[descriptor] = asyncio.Event()
            loop.add_reader(descriptor, sign.set)
            try:
                await asyncio.wait_for(sign.wait(), left)
            except TimeoutError:
                continue
            finally:
                if self._signs.pop(descriptor, None):  # else it may be another's by now
                    loop.remove_reader(descriptor)
        raise ClientClosedError(f"{self.address}: the client was closed")
