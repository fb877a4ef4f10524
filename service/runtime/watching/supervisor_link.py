"""What a process and its supervisor tell each other: signs of life, why it ends, and restarts.

They share a pair of SEQPACKET sockets: a record comes whole or not at all, nobody waits for the
other, and what a process said last can still be read when it is dead. The signs of life also go to
the service manager of a process that has one in place of a supervisor.
"""

import json
import socket
from collections.abc import Iterator, Mapping, MutableMapping
from contextlib import suppress
from enum import Enum
from typing import Any, Self

from denseface.service.runtime.closing import Closing
from denseface.service.runtime.watching.service_manager import ServiceManager

__all__ = ["LINK_VARIABLE", "Beat", "ProcessLink", "SupervisorLink"]

LINK_VARIABLE = "DENSEFACE_SUPERVISOR"
"""Environment variable with the descriptor of a process's end."""
_MAX_RECORD = 64 * 1024
"""Longest record, bytes."""
_WHY = b"w"
"""Begins the record that says why a process ends."""
_MAX_WHY = 400
"""Longest reason, bytes."""
_MAX_READ = 4096
"""Records read at a time: more than a socket's buffer holds."""


class Beat(Enum):
    """A sign of life; the value is its record."""

    IDLE = b"i"
    HOLDING = b"h"
    """As `IDLE`, of a process that holds a job: if it dies now, the job may be why."""


class SupervisorLink(Closing):
    """A process's end. Without a supervisor it says nothing and hears nothing."""

    def __init__(self, end: socket.socket | None = None,
                 manager: ServiceManager | None = None) -> None:
        self._end = end
        self.manager = manager or ServiceManager({})
        """Who started this process, if that was a service manager."""

    @classmethod
    def inherit(cls, environment: MutableMapping[str, str]) -> Self:
        """Take the end that the supervisor left, and all variables from the environment."""
        manager = ServiceManager(environment)
        descriptor = environment.pop(LINK_VARIABLE, "")
        if not descriptor.isdecimal():
            return cls(None, manager)
        try:
            end = socket.socket(fileno=int(descriptor))
        except OSError:  # the variable came from elsewhere
            return cls(None, manager)
        end.set_inheritable(False)
        end.setblocking(False)
        return cls(end, manager)

    @property
    def supervised(self) -> bool:
        """Whether somebody starts this process again when it ends."""
        return self._end is not None

    def beat(self, beat: Beat = Beat.IDLE) -> None:
        """Say that this process makes progress: to be called from what must not hang."""
        self.manager.alive()
        if self._end is not None:
            with suppress(OSError):  # full: the supervisor has enough to read; or it is dead
                self._end.send(beat.value)

    def say_why(self, reason: str) -> None:
        """Say why this process is about to end."""
        self.manager.status(reason)
        if self._end is not None:
            with suppress(OSError):
                self._end.send(_WHY + reason.encode(errors="replace")[:_MAX_WHY])

    def restarts(self) -> dict[str, Any] | None:
        """Give the newest counts that the supervisor sent; None where there are no new ones."""
        newest = None
        for record in _records(self._end) if self._end is not None else ():
            newest = record
        return None if newest is None else json.loads(newest)

    def close(self) -> None:
        """Close this end."""
        self.manager.close()
        if self._end is not None:
            self._end.close()


class ProcessLink(Closing):
    """The supervisor's end of one process."""

    def __init__(self) -> None:
        self._end, self._other = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._end.setblocking(False)
        self._other.setblocking(False)
        self.why = ""
        """Why the process ends, as far as it has said that and it was read."""

    @property
    def descriptor(self) -> int:
        """The process's end: to be inherited, with its number in `LINK_VARIABLE`."""
        return self._other.fileno()

    def started(self) -> None:
        """Close the process's end here: the process has it."""
        self._other.close()

    def last_beat(self) -> Beat | None:
        """Read all that the process said; give the last sign of life, None where there is none."""
        last = None
        for record in _records(self._end):
            if record.startswith(_WHY):
                self.why = record.removeprefix(_WHY).decode(errors="replace")
            with suppress(ValueError):
                last = Beat(record)
        return last

    def send_restarts(self, counts: Mapping[str, Mapping[str, int | str]]) -> bool:
        """Send how often all processes ended, and how last; False where that is stuck now."""
        try:
            self._end.send(json.dumps(counts).encode())
        except OSError:
            return False
        return True

    def close(self) -> None:
        """Close both ends."""
        self._end.close()
        self._other.close()


def _records(end: socket.socket) -> Iterator[bytes]:
    """Give the records that wait, until there are none or the other end is closed."""
    for _ in range(_MAX_READ):
        try:
            record = end.recv(_MAX_RECORD)
        except ConnectionResetError:  # it died before it read all; what it said comes next
            continue
        except BlockingIOError:
            return
        if not record:
            return
        yield record
