"""The client for asyncio: the calls of `service.client.blocking`, awaited.

The event loop watches the file descriptors of ZeroMQ's sockets. They become readable when
something may have happened, once: whatever has come must then be taken.
"""

import asyncio
import time
from collections.abc import AsyncIterator, Callable
from contextlib import closing, suppress
from datetime import datetime
from pathlib import Path
from typing import Self, TypeVar

import zmq

from denseface.capture import RgbdFrame
from denseface.recon.face import Consent, Face
from denseface.service.client._base import BaseClient
from denseface.service.client.events import (
    Published,
    PublishedFace,
    PublishedHint,
    PublishedPreview,
    hint_of,
    preview_of,
)
from denseface.service.client.exchanges import Exchange, SendRequest, Step, deadline
from denseface.service.client.follower import TOPICS, Follower
from denseface.service.client.statuses import LOOK_S, StatusWatch
from denseface.service.errors import ClientClosedError, ClientTimeoutError, RemoteProtocolError
from denseface.service.protocol.message_base import BaseRequest
from denseface.service.protocol.messages import Status
from denseface.service.protocol.sensor_messages import DEFAULT_GATE_S, Gate
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet, encode
from denseface.service.transport.connection import receive_packet
from denseface.service.transport.subscription import CHECK_INTERVAL_S, Subscription

_T = TypeVar("_T")


class AsyncClient(BaseClient):
    """A connection to the hub; for one event loop, whose tasks may share it.

    Parameters and errors are those of `service.client.blocking.Client`. A call that is cancelled is
    forgotten; what it asked for may happen all the same.
    """

    def __init__(
        self, address: str | None = None, *, key: str | Path | None = None,
        hub_key: str | Path | None = None,
        connect_timeout: float | None = None, on_waiting: Callable[[str], None] | None = None,
    ) -> None:
        super().__init__(address, key=key, hub_key=hub_key, connect_timeout=connect_timeout,
                         on_waiting=on_waiting)
        self._pending: dict[int, asyncio.Future[Packet]] = {}
        """Number of a request -> its answer."""
        self._loop: asyncio.AbstractEventLoop | None = None
        """Watches the socket for answers; None where none is awaited."""
        self._readable_events: dict[int, asyncio.Event] = {}
        """Descriptor of a subscription's socket -> set when it may be readable."""

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Disconnect; harmless when repeated, and in a process that was forked since.

        Ends every iteration and every call under way.
        """
        if self._forked():
            return
        self._unwatch()
        for answer in self._pending.values():
            if not answer.done():
                answer.set_exception(self._closed())
        while self._readable_events:
            descriptor, readable = self._readable_events.popitem()
            asyncio.get_running_loop().remove_reader(descriptor)
            readable.set()
        self._context.destroy(linger=0)

    async def press(
        self, capture_id: str | None = None, *, timeout: float = 15.0, sensor: str | None = None,
        gate: Gate = "off", gate_timeout: float = DEFAULT_GATE_S, frames: int = 1,
        consent: Consent | None = None,
    ) -> str:
        """Take a frame now; see `Client.press`."""
        return await self._run(self._exchanges.press(
            capture_id, timeout, sensor=sensor, gate=gate, gate_timeout=gate_timeout,
            frames=frames, consent=consent))

    async def withdraw(self, capture_id: str, *, timeout: float = 30.0) -> int:
        """Remove a capture, wherever it stands; see `Client.withdraw`.

        A `press` of it that is under way raises PressRefusedError.
        """
        return await self._run(self._exchanges.withdraw(capture_id, timeout))

    async def get(self, capture_id: str, *, timeout: float = 60.0) -> Face:
        """Wait for a capture's face; see `Client.get`."""
        return await self._run(self._exchanges.get(capture_id, timeout))

    async def get_frame(self, capture_id: str, *, timeout: float = 15.0) -> RgbdFrame:
        """Fetch the frame of a capture, whatever became of it; see `Client.get_frame`."""
        return await self._run(self._exchanges.get_frame(capture_id, timeout))

    async def status(self, *, timeout: float = 5.0) -> Status:
        """Ask who is there and what was done; see `Client.status`."""
        return await self._run(self._exchanges.status(timeout))

    async def statuses(self, *, timeout: float | None = None) -> AsyncIterator[Status | None]:
        """Follow how the hub is, None where it is gone; see `Client.statuses`."""
        with suppress(ClientClosedError), closing(self._subscribe(Topic.STATUS)) as subscription:
            watch = StatusWatch(subscription, time.monotonic())
            while True:
                until = deadline(timeout)
                self._check_open()
                while (news := watch.look(now := time.monotonic())) is None:
                    if now >= until:
                        raise self._nothing_published(subscription)
                    await self._readable(subscription.socket, LOOK_S)
                yield news.status

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

    def previews(
        self, *, sensor: str | None = None, timeout: float | None = None
    ) -> AsyncIterator[PublishedPreview]:
        """Follow what a sensor sees, always the newest; see `Client.previews`."""
        return self._newest(Topic.PREVIEW, lambda packet: preview_of(packet, sensor), timeout)

    def hints(
        self, *, sensor: str | None = None, timeout: float | None = None
    ) -> AsyncIterator[PublishedHint]:
        """Follow what could be better in front of a sensor; see `Client.hints`."""
        return self._newest(Topic.HINTS, lambda packet: hint_of(packet, sensor), timeout)

    async def _newest(
        self, topic: Topic, read: Callable[[Packet], _T | None], timeout: float | None
    ) -> AsyncIterator[_T]:
        with suppress(ClientClosedError), closing(self._subscribe(topic)) as subscription:
            while True:
                until = deadline(timeout)
                newest = None
                while newest is None:
                    await self._wait(subscription, until - time.monotonic())
                    newest = subscription.receive_latest(read)
                yield newest

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
            raise TypeError("an exchange that awaits publications needs a subscription")
        await self._wait(subscription, step.timeout)
        return subscription.receive()

    async def _send_request(
        self, message: BaseRequest, timeout: float, subscription: Subscription | None = None
    ) -> Packet:
        """Send until answered; raises as `_send`, and where the hub cannot answer."""
        self._check_open()
        parts = encode(Packet(message))
        answer = self._pending[message.request] = asyncio.get_running_loop().create_future()
        until = time.monotonic() + timeout
        try:
            while (left := until - time.monotonic()) > 0:
                self._exchanges.check(message)
                wait = self._send(parts, subscription)
                self._watch()
                await asyncio.wait([answer], timeout=min(left, wait))
                if answer.done():
                    return self._checked(answer.result())
        finally:
            del self._pending[message.request]
            if not answer.cancel() and not answer.cancelled():
                answer.exception()  # marked as retrieved: the call may have been cancelled
            if not self._pending:
                self._unwatch()
        raise self._no_answer(timeout)

    def _watch(self) -> None:
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
            self._loop.add_reader(self._socket.fileno(), self._take_answers)
        self._take_answers()  # after sending, the descriptor does not tell of what had come before

    def _unwatch(self) -> None:
        if self._loop is not None:
            if not self._forked():  # which shares what the loop watches with this process
                self._loop.remove_reader(self._socket.fileno())
            self._loop = None

    def _take_answers(self) -> None:
        while not self._forked():
            try:
                packet = receive_packet(self._socket, zmq.DONTWAIT)
            except zmq.Again:
                return
            except RemoteProtocolError as error:
                answer = self._pending.get(error.request) if error.request is not None else None
                if answer is not None and not answer.done():
                    answer.set_exception(self._unreadable(error))
                continue
            answer = self._pending.get(getattr(packet.message, "request", 0))
            if answer is not None and not answer.done():
                answer.set_result(packet)

    async def _wait(self, subscription: Subscription, timeout: float) -> None:
        until = time.monotonic() + timeout
        while not await self._readable(
                subscription.socket, min(until - time.monotonic(), CHECK_INTERVAL_S)):
            self._check_subscription(subscription)
            if time.monotonic() >= until:
                raise self._nothing_published(subscription)
        self._hub_wait.end()

    async def _readable(self, socket: zmq.Socket[bytes], seconds: float) -> bool:
        """Wait until there is something to receive; False where there is nothing in this time."""
        loop = asyncio.get_running_loop()
        until = loop.time() + seconds
        while not socket.closed:
            self._check_process()
            if socket.poll(0):
                return True
            left = until - loop.time()
            if left <= 0:
                return False
            descriptor = socket.fileno()
            readable = self._readable_events[descriptor] = asyncio.Event()
            loop.add_reader(descriptor, readable.set)
            try:
                # Not `wait_for`: before 3.12 it forgets a cancellation that comes with a message.
                async with asyncio.timeout(left):
                    await readable.wait()
            except TimeoutError:
                continue
            finally:
                # Where `close` removed it, the number may be another's by now.
                if self._readable_events.pop(descriptor, None) and not self._forked():
                    loop.remove_reader(descriptor)
        raise self._closed()
