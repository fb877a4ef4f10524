"""A short history of a hub in one process, whose disk may fail: what was said, seen and kept.

A press, its face, a dead letter, a purge, the id pressed again, a capture that waits. Then the hub
ends, and another one on a sound disk goes on.
"""

import json
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, field
from pathlib import Path
from typing import Any

from denseface.recon.settings import Settings
from denseface.service.errors import ServiceError
from denseface.service.hub import Hub
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.outgoing import Output, Publish, Send
from denseface.service.protocol.payload import FaceHeader, FrameHeader
from denseface.service.protocol.topics import Topic
from denseface.service.protocol.wire import Packet
from denseface.service.settings import ServiceSettings
from denseface.service.storage import FolderLayout, FolderStore
from tests.chaos.history import Answer, History, Kept, Seen
from tests.chaos.kept import read_kept
from tests.unit.service.faces import small_face, small_frame

__all__ = ["Events", "after", "before"]

_SENSOR, _CLIENT, _WORKER = b"sensor", b"client", b"worker"
_FRAME, _FRAME_ARRAYS = FrameHeader.of(small_frame())
_FACE, _FACE_ARRAYS = FaceHeader.of(small_face())
_SETTINGS = ServiceSettings(
    address="ipc:///unused", attempts=1, queue=9, reserve_mib=0, retention=None)
_PATIENCE = 3
"""Ticks that a client waits for an answer."""


@dataclass
class Events:
    """What came out of a hub. An id that is pressed again after its removal is another capture."""

    tell: Callable[[str], None] = lambda _: None
    """Is told each answer when it is given."""
    pressed: dict[str, Answer] = field(default_factory=dict)
    published: list[Seen] = field(default_factory=list)
    followed: list[Seen] = field(default_factory=list)
    """As `published`, by somebody who asks for what comes after the last that he knows."""
    lives: dict[str, int] = field(default_factory=dict)
    """How often an id was pressed."""
    faults: list[str] = field(default_factory=list)
    """Errors that have no name."""

    @classmethod
    def of(cls, told: Sequence[str]) -> "Events":
        """Read what `tell` was told."""
        events = cls()
        for text in told:
            kind, *rest = json.loads(text)
            if kind == "published":
                events.published.append(Seen(*rest))
            elif kind == "followed":
                events.followed.append(Seen(*rest))
            else:
                name, answer = rest
                events.pressed[name] = Answer(answer)
                capture_id, _, life = name.partition("#")
                events.lives[capture_id] = int(life)
        return events

    def name(self, capture_id: str) -> str:
        return f"{capture_id}#{self.lives.get(capture_id, 0)}"

    def answer(self, capture_id: str, answer: Answer) -> None:
        self.pressed[self.name(capture_id)] = answer
        self.tell(json.dumps(["answer", self.name(capture_id), answer]))

    def answer_to(self, capture_id: str) -> Answer | None:
        """Give what was said of an id last."""
        return self.pressed.get(self.name(capture_id))

    def begin(self, capture_id: str) -> None:
        self.lives[capture_id] = self.lives.get(capture_id, 0) + 1
        self.answer(capture_id, Answer.UNKNOWN)

    def seen(self, message: BaseMessage) -> Seen:
        match message:
            case messages.FaceDone():
                state = "done"
            case messages.CaptureFailed(dead=dead):
                state = "dead" if dead else "failed"
            case _:
                raise TypeError(message.kind)
        return Seen(message.epoch, message.sequence, self.name(message.capture_id), state)


class _Play:
    """A hub and everybody around it."""

    def __init__(self, folder: Path, events: Events) -> None:
        self.store = FolderStore(folder)
        self.hub = Hub(self.store, _SETTINGS, Settings())
        self.events = events
        self.now, self.request, self.credit = 100.0, 0, 0
        self.jobs: list[messages.Job] = []
        self.say(_SENSOR, messages.SensorReady(name="s", source="x.oni"))
        self.say(_WORKER, messages.WorkerReady(name="w", credit=0))

    def say(self, peer: bytes, message: BaseMessage, arrays: Any = None) -> list[BaseMessage]:
        return self._sent(self.hub.receive(self.now, peer, Packet(message, arrays or {})))

    def tick(self) -> list[BaseMessage]:
        self.now += 1.1  # longer than the hub waits for a disk that refused something
        for peer in (_SENSOR, _WORKER):
            self.say(peer, messages.Heartbeat())
        return self._sent(self.hub.tick(self.now))

    def _sent(self, outputs: list[Output]) -> list[BaseMessage]:
        """Note what is published, take frames and jobs, give the answers to the client."""
        answers = []
        for one in outputs:
            message = one.packet.message
            if isinstance(one, Publish):
                if one.topic is Topic.FACES:
                    self._see("published", message)
            elif isinstance(one, Send) and one.peer == _CLIENT:
                answers.append(message)
            elif isinstance(message, messages.Take):
                answers += self.say(_SENSOR, messages.Frame(
                    capture_id=message.capture_id, frame=_FRAME), _FRAME_ARRAYS)
            elif isinstance(message, messages.Job):
                self.jobs.append(message)
        return answers

    def ask(self, make: Callable[[int], BaseMessage]) -> BaseMessage | None:
        """Send one request, again after each tick, until it is answered."""
        self.request += 1
        answers = []
        for _ in range(_PATIENCE):
            answers += self.say(_CLIENT, make(self.request))
            if not answers:
                answers += self.tick()
            for one in answers:
                if getattr(one, "request", 0) == self.request:
                    return one
        return None

    def press(self, capture_id: str) -> None:
        self.events.begin(capture_id)
        match self.ask(lambda request: messages.Press(request=request, capture_id=capture_id)):
            case messages.PressAccepted():
                self.events.answer(capture_id, Answer.ACCEPTED)
            case messages.PressRefused():
                self.events.answer(capture_id, Answer.REFUSED)

    def _see(self, how: str, message: BaseMessage) -> None:
        seen = self.events.seen(message)
        getattr(self.events, how).append(seen)
        self.events.tell(json.dumps([how, *astuple(seen)]))

    def follow(self) -> None:
        """Ask for all outcomes that are new."""
        while True:
            last = self.events.followed[-1:]
            after = last[0].sequence if last and last[0].epoch == self.store.epoch else 0
            answer = self.ask(
                lambda request: messages.GetNext(request=request, after=after))  # noqa: B023
            if not isinstance(answer, messages.FaceDone | messages.CaptureFailed):
                return
            self._see("followed", answer)

    def purge(self, capture_id: str) -> None:
        refused = self.events.answer_to(capture_id) is Answer.REFUSED
        if not refused:
            self.events.answer(capture_id, Answer.WITHDRAWN)
        answer = self.ask(lambda request: messages.Purge(request=request, capture_id=capture_id))
        if isinstance(answer, messages.Removed) and not refused:
            self.events.answer(capture_id, Answer.REMOVED)

    def work(self, fail: str = "") -> None:
        """Do a job if there is one; that of the capture `fail` fails."""
        self.credit += 1
        self.say(_WORKER, messages.WorkerReady(name="w", credit=self.credit))
        for _ in range(_PATIENCE):
            if not self.jobs:
                self.tick()
        while self.jobs:
            job = self.jobs.pop()
            common = {"capture_id": job.capture_id, "settings_hash": job.settings_hash,
                      "frame_sha256": job.frame_sha256}
            if job.capture_id == fail:
                self.say(_WORKER, messages.JobFailed(
                    **common, error="Error", message="why", final=False))
            else:
                self.say(_WORKER, messages.Result(**common, face=_FACE), _FACE_ARRAYS)
        self.follow()


def before(folder: Path, events: Events, hub: int, *, stops: bool) -> None:
    """Let the first or second hub (0 or 1) live as long as its disk lets it.

    It stops in order where it `stops`, else it is killed.
    """
    try:
        play = _Play(folder, events)
        _first(play) if hub == 0 else _second(play)
        if stops:
            play.store.close()
    except ServiceError:
        pass  # the hub ends, for a reason that has a name
    except Exception as error:
        events.faults.append(f"the hub ended without a reason: {error!r}")


def _first(play: _Play) -> None:
    play.press("face")
    play.work()
    play.press("dead")
    play.work(fail="dead")
    play.purge("face")
    if play.events.answer_to("face") is not Answer.WITHDRAWN:  # whose is it then?
        play.press("face")
    play.press("gone")
    play.purge("gone")
    play.press("waits")
    play.tick()


def _second(play: _Play) -> None:
    play.work()
    play.press("more")
    play.purge("waits")
    play.work()
    play.tick()


def after(folder: Path, events: Events) -> History:
    """Let another hub, on a sound disk, go on to the end; everything is followed."""
    play = _Play(folder, events)
    for _ in range(8):
        play.work()
        play.tick()
    play.store.close()
    kept = [Kept(events.name(one.capture_id), one.state, one.sequence, one.sound)
            for one in read_kept(folder)]
    history = History(events.pressed, events.followed, events.published, kept)
    events.faults += _left_behind(folder, {one.capture_id for one in kept}, events)
    return history


def _left_behind(folder: Path, kept: set[str], events: Events) -> Iterator[str]:
    """Give the pictures that belong to nothing that is kept."""
    layout = FolderLayout(folder)
    for where in (layout.frames, layout.faces, layout.quarantine):
        for path in where.iterdir():
            if events.name(path.name.lstrip(".").partition(".")[0]) not in kept:
                yield f"{where.name}/{path.name}: left behind"
