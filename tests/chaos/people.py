"""Who presses and who looks on: threads that write down what they were told."""

import threading
import time
from collections.abc import Callable, Iterator
from typing import Self

import zmq

from denseface.service.client import Client, PublishedFace
from denseface.service.errors import PressRefusedError, ProtocolError, ServiceError
from denseface.service.protocol.messages import CaptureFailed, FaceDone
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import decode_from_hub
from denseface.service.transport.addresses import publications_of
from tests.chaos.history import Answer, Seen
from tests.waiting import LIMIT_S, PATIENCE

__all__ = ["Follower", "Listener", "Presser"]

_ASK_S = 3.0 * PATIENCE
"""Longest wait of one try, seconds."""
_PAUSE_S = 0.05
_LOOK_S = 0.005
_POLL_MS = 50


class _Person:
    def __init__(self) -> None:
        self._leave = threading.Event()
        self.error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.leave()

    def leave(self) -> None:
        """End, and raise what went wrong."""
        self._leave.set()
        self._thread.join(LIMIT_S)
        if self._thread.is_alive():
            raise TimeoutError(f"{type(self).__name__} does not come to an end")
        if self.error:
            raise self.error

    def _run(self) -> None:
        try:
            self._live()
        except BaseException as error:
            self.error = error

    def _live(self) -> None:
        raise NotImplementedError


class Presser(_Person):
    """Presses until `wanted` captures are accepted; a refused id is not used again.

    Parameters
    ----------
    ahead : waits while so many of its accepted presses have not been `saw`n to end

    Attributes
    ----------
    answers : what was said of each id, in order
    began : when each id was first pressed, seconds
    """

    def __init__(
        self, address: str, name: str, wanted: int, *, saw: Callable[[str], bool],
        ahead: int | None = None, tries: int = 60,
    ) -> None:
        super().__init__()
        self._address = address
        self._name = name
        self._wanted = wanted
        self._tries = tries
        self._saw = saw
        self._ahead = ahead or wanted
        self._open: set[str] = set()
        """Accepted, and not yet seen to end."""
        self.answers: dict[str, Answer] = {}
        self.began: dict[str, float] = {}
        self.reasons: list[str] = []

    @property
    def accepted(self) -> int:
        """How many presses were accepted."""
        return sum(answer is Answer.ACCEPTED for answer in self.answers.copy().values())

    def done(self) -> bool:
        """Say whether all wanted presses are accepted."""
        return not self._thread.is_alive()

    def _live(self) -> None:
        with Client(self._address) as client:
            for capture_id in self._ids():
                self.began[capture_id] = time.monotonic()
                self.answers[capture_id] = Answer.UNKNOWN
                self.answers[capture_id] = self._press(client, capture_id)
                if self.answers[capture_id] is Answer.ACCEPTED:
                    self._open.add(capture_id)
                else:
                    self._leave.wait(_PAUSE_S)

    def _wait(self) -> None:
        while not self._leave.is_set():
            self._open = {one for one in self._open if not self._saw(one)}
            if len(self._open) < self._ahead:
                return
            self._leave.wait(_LOOK_S)

    def _ids(self) -> Iterator[str]:
        number = 0
        while self.accepted < self._wanted and not self._leave.is_set():
            self._wait()
            number += 1
            yield f"{self._name}-{number}"

    def _press(self, client: Client, capture_id: str) -> Answer:
        for _ in range(self._tries):
            try:
                client.press(capture_id, timeout=_ASK_S)
            except PressRefusedError as error:
                self.reasons.append(str(error))
                return Answer.REFUSED
            except ServiceError:
                if self._leave.is_set():
                    break
            else:
                return Answer.ACCEPTED
        return Answer.UNKNOWN


class Follower(_Person):
    """Follows by sequence with the client library; `restart` lets it begin anew where it was."""

    def __init__(self, address: str) -> None:
        super().__init__()
        self._address = address
        self.seen: list[Seen] = []
        self.at: dict[str, float] = {}
        """When each capture was seen first, seconds."""
        self._again = threading.Event()

    def restart(self) -> None:
        """Disconnect and connect again, soon."""
        self._again.set()

    def saw(self, capture_id: str) -> bool:
        """Say whether a capture's end was seen."""
        return capture_id in self.at

    def _live(self) -> None:
        while not self._leave.is_set():
            self._again.clear()
            after = self.seen[-1].sequence if self.seen else 0
            with Client(self._address) as client:
                self._follow(client, after)

    def _follow(self, client: Client, after: int) -> None:
        try:
            for one in client.published(after=after, timeout=0.5):
                state = "done" if isinstance(one, PublishedFace) else (
                    "dead" if one.error.dead else "failed")
                capture_id = one.capture_id
                if isinstance(one, PublishedFace) and one.face.report.capture_id != capture_id:
                    capture_id = f"{capture_id} with the face of {one.face.report.capture_id}"
                self.seen.append(Seen(one.epoch, one.sequence, capture_id, state))
                self.at.setdefault(capture_id, time.monotonic())
                if self._leave.is_set() or self._again.is_set():
                    return
        except ServiceError:
            return  # nothing came, or the hub is away: from where it was, again


class Listener(_Person):
    """Reads the bare publications, without asking for anything."""

    def __init__(self, address: str) -> None:
        super().__init__()
        self._address = publications_of(address)
        self.seen: list[Seen] = []

    def _live(self) -> None:
        with zmq.Context() as context, context.socket(zmq.SUB) as socket:
            socket.set(zmq.LINGER, 0)
            socket.set(zmq.RECONNECT_IVL, 20)
            socket.subscribe(Topic.FACES)
            socket.connect(self._address)
            while not self._leave.is_set():
                if socket.poll(_POLL_MS):
                    self._note(socket.recv_multipart()[1:])

    def _note(self, parts: list[bytes]) -> None:
        try:
            message = decode_from_hub(parts).message
        except ProtocolError:
            return
        if isinstance(message, FaceDone):
            state = "done"
        elif isinstance(message, CaptureFailed):
            state = "dead" if message.dead else "failed"
        else:
            return
        self.seen.append(Seen(message.epoch, message.sequence, message.capture_id, state))
