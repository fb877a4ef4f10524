"""What the hub's process says before its data folder is open: how far it is, and nothing else."""

import time

import structlog

from denseface.service.errors import RemoteProtocolError
from denseface.service.monitoring import Rejections
from denseface.service.protocol import messages
from denseface.service.protocol.wire import Packet, encode
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.signals import StopSignal
from denseface.service.runtime.watching.supervisor_link import SupervisorLink
from denseface.service.security.permissions import missing_role
from denseface.service.security.refusals import Refusals
from denseface.service.storage import FolderStore, OpeningStore
from denseface.service.transport.listener import Incoming
from denseface.service.transport.listeners import Listeners
from denseface.version import VERSION

__all__ = ["Opening"]

_TICK_S = 0.25
_MAX_WAITING = 1000
"""Messages that wait until the folder is open; of more, the oldest are dropped, and said again."""
_NO_EPOCH = "0"
"""In a status, while it is not known."""
_LOG_S = 10.0
"""Time between two lines about a rebuild, seconds."""


class Opening:
    """Waits for a store while a hub listens already.

    Requests wait with it: their clients repeat them, and nobody can say what is known of a capture
    before all files are read.
    """

    def __init__(
        self, listeners: Listeners, opening: OpeningStore, rejections: Rejections,
        supervisor: SupervisorLink,
    ) -> None:
        self._listeners = listeners
        self._opening = opening
        self._progress = opening.progress
        self._rejections = rejections
        self._supervisor = supervisor
        self._refusals = Refusals()
        self._waiting: BoundedDict[tuple[bytes, str, object], Incoming] = BoundedDict(_MAX_WAITING)
        """By peer, kind and request: the last of what is said again and again."""

    def wait(self, stop: StopSignal) -> FolderStore | None:
        """Wait for the store, and give it; None where this process is told to stop.

        Raises as `OpeningStore.store` and `Listeners.receive`.
        """
        due = said = time.monotonic()
        while not stop:
            if (store := self._opening.store()) is not None:
                return store
            if (now := time.monotonic()) >= due:
                due = now + _TICK_S
                self._supervisor.beat()
                self._say_how_far()
                self._listeners.tick()
            if self._progress.files and now - said >= _LOG_S:
                said = now
                structlog.get_logger("hub").info(
                    "reading files", read=self._progress.read, files=self._progress.files)
            for incoming in self._listeners.receive(round(1000 * _TICK_S)):
                self._receive(incoming)
            stop.drain()
        return None

    def waiting(self) -> list[Incoming]:
        """Give what was said meanwhile by peers that may still say it."""
        return [one for one in self._waiting.values() if self._listeners.is_allowed(one.peer)]

    def refuse(self, incoming: Incoming, error: RemoteProtocolError) -> None:
        """Count a malformed message and tell its sender what is wrong with it."""
        self._rejections.note(error.reason, key=incoming.sender.name, address=incoming.address,
                              detail=str(error))
        if answer := self._refusals.answer(
                incoming.key or incoming.peer, incoming.parts, error):
            self._listeners.send(incoming.peer, encode(Packet(answer)))

    def _say_how_far(self) -> None:
        """Tell the service manager: whoever asks while files are read gets that answer."""
        if files := self._progress.files:
            self._supervisor.manager.ready(f"reads its files, {self._progress.read} of {files}")
        else:
            self._supervisor.manager.status("opens the data folder")

    def _receive(self, incoming: Incoming) -> None:
        try:
            packet = incoming.packet()
        except RemoteProtocolError as error:
            self.refuse(incoming, error)
            return
        message = packet.message
        if isinstance(message, messages.GetStatus) and not missing_role(
                incoming.sender.roles, message):
            self._listeners.send(incoming.peer, encode(Packet(self._status(message.request))))
        elif not packet.arrays:  # nobody was asked for a frame or a face
            request = getattr(message, "request", None)
            self._waiting[incoming.peer, message.kind, request] = incoming

    def _status(self, request: int) -> messages.Status:
        files = self._progress.files
        return messages.Status(
            request=request, epoch=_NO_EPOCH, sequence=0, hub_version=VERSION,
            sensors=(), workers=(), pressed=0, queued=0, working=0, done=0, failed=0, dead=0,
            refused=self._rejections.counts(), presses_refused={}, since_start={}, latencies={},
            restarts={}, state="rebuilding" if files else "opening",
            files_read=self._progress.read, files_to_read=files)
