"""The blocking client: press, wait for faces, follow what is published.

Every call has a time-out. Requests are repeated until answered, so a restart of the hub goes
unnoticed; repeating is safe, for an id is one capture however often it is pressed.
"""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from datetime import datetime
from typing import TypeVar

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
from denseface.service.errors import ClientTimeoutError, RemoteProtocolError
from denseface.service.protocol.message_base import BaseRequest
from denseface.service.protocol.messages import Status
from denseface.service.protocol.sensor_messages import DEFAULT_GATE_S, Gate
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet, encode
from denseface.service.runtime.closing import Closing
from denseface.service.transport.connection import receive_packet
from denseface.service.transport.subscription import CHECK_INTERVAL_S, Subscription

_T = TypeVar("_T")


class Client(Closing, BaseClient):
    """A connection to the hub; for one thread.

    Parameters
    ----------
    address : the hub's; where None, `DENSEFACE_ADDRESS` or this user's own hub
    key, hub_key : files of one's own secret key and of the hub's public one, for a hub elsewhere;
        where None, `DENSEFACE_KEY` and `DENSEFACE_HUB_KEY`
    connect_timeout : longest wait of a call for the first connection to a hub, seconds; where None,
        as long as the call may take. A hub that is started again is waited for in any case
    on_waiting : is given one line, once, where there is no connection for a second: that the hub is
        waited for, and why it is not there

    Every call raises `KeyRefusedError` where the hub refuses this key, `ClientTimeoutError` where
    nothing came in `timeout` seconds, `RequestFailedError` where the hub cannot answer or does not
    understand, and `RemoteProtocolError` where its answer cannot be read, as of another release. In
    a process that was forked after the client was made every call but `close` raises
    `ClientForkedError`.

    Raises
    ------
    SettingsError
        Where the address is malformed, its socket file or the folder of that is someone else's, or
        a key file cannot be used.
    """

    def close(self) -> None:
        """Disconnect; harmless when repeated, and in a process that was forked since.

        Ends every iteration over `faces`.
        """
        if not self._forked():
            self._context.destroy(linger=0)

    def press(
        self, capture_id: str | None = None, *, timeout: float = 15.0, sensor: str | None = None,
        gate: Gate = "off", gate_timeout: float = DEFAULT_GATE_S, frames: int = 1,
        consent: Consent | None = None,
    ) -> str:
        """Take a frame now; give the capture's id once the frame is safe at the hub.

        Parameters
        ----------
        capture_id : letters, digits, `-`, `_`, at most 64; pressing an id again is the same
            capture; where None, a new one
        sensor : its name, as `status` has it; where None, the one that is best off
        gate : `off`, or what becomes of a frame that is not good enough: `refuse` the press,
            `wait` for a good one, or take the `best` of some time
        gate_timeout : that time, or the longest wait, seconds, at most 120; `timeout` comes to it
        frames : consecutive frames that are made into one, at most 32
        consent : what the person agreed to; the hub keeps it with the capture and says it in the
            face's report. Where it names a time, all of the capture is removed after that, however
            long the hub keeps others

        Raises
        ------
        PressRefusedError
            There is no such capture and none will appear: no sensor, no frame, no room. Where no
            frame was good enough, its `reason` is `quality`, its `text` says what to do better.
        ClientTimeoutError
            The hub did not answer; press the same id again to be sure.
        LocalProtocolError
            The id or another argument is malformed.
        """
        return self._run(self._exchanges.press(
            capture_id, timeout, sensor=sensor, gate=gate, gate_timeout=gate_timeout,
            frames=frames, consent=consent))

    def withdraw(self, capture_id: str, *, timeout: float = 30.0) -> int:
        """Remove a capture that was pressed with this key, wherever it stands.

        A press that waits for its frame is refused, a face that is being made is dropped. When this
        returns nothing is left at the hub: no frame, no face, no row. The id cannot be pressed
        again. Gives how many captures were removed: 0 where it was gone, or is another key's.

        Raises
        ------
        RequestFailedError
            The disk refuses or does not answer, or another program has the hub's database open:
            withdraw again.
        """
        return self._run(self._exchanges.withdraw(capture_id, timeout))

    def get(self, capture_id: str, *, timeout: float = 60.0) -> Face:
        """Wait for a capture's face.

        Raises
        ------
        CaptureFailedError
            The capture ended without a face.
        UnknownCaptureError
            The hub has no such capture.
        LocalProtocolError
            The id is malformed.
        """
        return self._run(self._exchanges.get(capture_id, timeout))

    def get_frame(self, capture_id: str, *, timeout: float = 15.0) -> RgbdFrame:
        """Fetch the frame of a capture, whatever became of it: also where there is no face.

        For the key that pressed it, an operator, and on the hub's own machine.

        Raises
        ------
        UnknownCaptureError
            The hub has no such capture.
        RequestFailedError
            The frame is damaged, or this key may not have it.
        """
        return self._run(self._exchanges.get_frame(capture_id, timeout))

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
        LocalProtocolError
            More than one start is given, `last` is not positive or `since` has no zone.
        """
        follower = Follower(self._exchanges, after, last, since)
        with closing(self._subscribe(*TOPICS)) as subscription:
            self._run(follower.start(timeout), subscription)
            while True:
                yield self._run(follower.next(timeout), subscription)

    def previews(
        self, *, sensor: str | None = None, timeout: float | None = None
    ) -> Iterator[PublishedPreview]:
        """Follow what a sensor sees, thirty times a second at most: always the newest.

        Nothing is kept of them: what does not come in time is skipped. A live sensor shows its
        newest picture, a recording the one that the next press gives.

        Parameters
        ----------
        sensor : its name; where None, of all sensors
        timeout : longest wait for the next one, seconds; where None, for ever
        """
        return self._newest(Topic.PREVIEW, lambda packet: preview_of(packet, sensor), timeout)

    def hints(
        self, *, sensor: str | None = None, timeout: float | None = None
    ) -> Iterator[PublishedHint]:
        """Follow what could be better in front of a sensor, about ten times a second.

        Always the newest, as of `previews`; so are the parameters.
        """
        return self._newest(Topic.HINTS, lambda packet: hint_of(packet, sensor), timeout)

    def _newest(
        self, topic: Topic, read: Callable[[Packet], _T | None], timeout: float | None
    ) -> Iterator[_T]:
        with closing(self._subscribe(topic)) as subscription:
            while True:
                until = deadline(timeout)
                newest = None
                while newest is None:
                    self._wait(subscription, until - time.monotonic())
                    newest = subscription.receive_latest(read)
                yield newest

    def statuses(self, *, timeout: float | None = None) -> Iterator[Status | None]:
        """Follow how the hub is: at each of its heartbeats, and at once where it changes.

        None, once, where the hub is gone: within a quarter of a second where its process ended,
        after three heartbeats where it or the network is silent. It goes on when the hub is back.

        Parameters
        ----------
        timeout : longest wait for the next one, seconds; where None, for ever
        """
        with closing(self._subscribe(Topic.STATUS)) as subscription:
            watch = StatusWatch(subscription, time.monotonic())
            while True:
                until = deadline(timeout)
                self._check_open()
                while (news := watch.look(now := time.monotonic())) is None:
                    if now >= until:
                        raise self._nothing_published(subscription)
                    subscription.socket.poll(int(LOOK_S * 1000))
                yield news.status

    def status(self, *, timeout: float = 5.0) -> Status:
        """Ask who is there and what was done."""
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
            raise TypeError("an exchange that awaits publications needs a subscription")
        self._wait(subscription, step.timeout)
        return subscription.receive()

    def _wait(self, subscription: Subscription, timeout: float) -> None:
        self._check_process()
        until = time.monotonic() + timeout
        while not subscription.socket.poll(
                max(0, math.ceil(min(until - time.monotonic(), CHECK_INTERVAL_S) * 1000))):
            self._check_subscription(subscription)
            if time.monotonic() >= until:
                raise self._nothing_published(subscription)
        self._hub_wait.end()

    def _send_request(
        self, message: BaseRequest, timeout: float, subscription: Subscription | None = None
    ) -> Packet:
        """Send until answered; raises as `_send`, and where the hub cannot answer."""
        self._check_open()
        parts = encode(Packet(message))
        until = time.monotonic() + timeout
        while (left := until - time.monotonic()) > 0:
            self._exchanges.check(message)
            wait = self._send(parts, subscription)
            if answer := self._answer(message.request, min(left, wait)):
                return self._checked(answer)
        raise self._no_answer(timeout)

    def _answer(self, request: int, wait: float) -> Packet | None:
        until = time.monotonic() + wait
        while True:
            left = until - time.monotonic()
            if not self._socket.poll(max(0, math.ceil(left * 1000))):
                return None
            try:
                packet = receive_packet(self._socket)
            except RemoteProtocolError as error:
                if error.request == request:
                    raise self._unreadable(error) from error
                continue
            if getattr(packet.message, "request", None) == request:
                return packet
