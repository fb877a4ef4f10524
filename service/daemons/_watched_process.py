"""One process of the table: how it is started, when it hangs, how often it is started again."""

import os
import signal
import subprocess
import sys
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from denseface.service.runtime.signals import PARENT_VARIABLE
from denseface.service.runtime.watching.supervisor_link import LINK_VARIABLE, Beat, ProcessLink

__all__ = ["AttendedClock", "End", "ProcessSpec", "WatchedProcess"]

_BACKOFF_S = 0.5
"""Pause before the restart that follows a first end, seconds; doubled at each further one."""
_BACKOFF_MAX_S = 30.0
"""Longest pause before a restart, seconds."""
_STORM_S = 60.0
"""Time over which restarts are counted, seconds."""
_STORM_RESTARTS = 5
"""More restarts than this in `_STORM_S`: something is wrong that a restart does not mend."""
_START_S = 600.0
"""Longest start, seconds: there may be kernels to compile, or a large data folder to read."""


@dataclass(frozen=True)
class ProcessSpec:
    """One row of the process table."""

    name: str
    arguments: tuple[str, ...]
    """Of the command `denseface`."""
    environment: dict[str, str] = field(default_factory=dict)
    """Added to the supervisor's own."""
    vital: bool = True
    """All stop where this one ends again and again; else it is tried for ever."""
    needed: bool = True
    """All stop where this one says that its usage or input is wrong; else it is tried again."""


class AttendedClock:
    """Counts the time in which its owner was attentive, by which others may be judged.

    An owner that looks later than it meant to was stopped, or its machine was asleep or loaded;
    the others may have been too, and what they said has waited. So a look counts for no more than
    the time that was to lie between two.

    Parameters
    ----------
    most_s : longest time that the owner means to be away, seconds
    clock : seconds
    """

    def __init__(self, most_s: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._most_s = most_s
        self._clock = clock
        self._looked = clock()
        self._attended = 0.0

    def look(self) -> float:
        """Give the attended time until now, seconds."""
        now = self._clock()
        self._attended += min(now - self._looked, self._most_s)
        self._looked = now
        return self._attended


@dataclass(frozen=True)
class End:
    """How a process ended."""

    status: int
    """Its exit status, or the number of the signal that ended it, negative."""
    reason: Literal["exited", "hung"]
    holding: bool
    """Whether it held a job."""


@dataclass
class WatchedProcess:
    """A row of the table and the process that runs for it."""

    spec: ProcessSpec
    running: subprocess.Popen[bytes] | None = None
    due: float = 0.0
    """When to start, by the monotonic clock, seconds."""
    counts: Counter[str] = field(default_factory=Counter)
    """How often it ended, by `End.reason`."""
    last_end: str = ""
    """How it ended last, and why, as far as it said."""
    _link: ProcessLink | None = None
    _beat: Beat | None = None
    """The last sign of life; None while it starts."""
    _heard: float = 0.0
    """When that came, or it was started: seconds of the supervisor's `AttendedClock`."""
    _ticks: int = 0
    """Processor time that it had used when that last grew, clock ticks."""
    _worked: float = 0.0
    """When that was, as `_heard`."""
    _killed: bool = False
    """Because it hung."""
    _restarts: deque[float] = field(default_factory=deque)
    """Times of those that count for a storm, by the monotonic clock, seconds."""

    @property
    def started(self) -> bool:
        """Whether the process that runs has given a sign of life."""
        return self._beat is not None

    def start(self, attended: float) -> None:
        """Start the process now, `attended` by the supervisor's `AttendedClock`."""
        link = ProcessLink()
        environment = os.environ | self.spec.environment | {
            PARENT_VARIABLE: str(os.getpid()), LINK_VARIABLE: str(link.descriptor)}
        try:
            # -P: a folder `denseface` in the working directory is not ours. A process group of its
            # own: Ctrl-C reaches the supervisor alone, which stops all in order.
            self.running = subprocess.Popen(
                [sys.executable, "-P", "-m", "denseface", *self.spec.arguments],
                env=environment, stdin=subprocess.DEVNULL, process_group=0,
                pass_fds=[link.descriptor])
        except BaseException:
            link.close()
            raise
        link.started()
        self._link, self._beat, self._killed = link, None, False
        self._heard, self._worked, self._ticks = attended, attended, 0

    def kill_if_hung(self, attended: float, limit_s: float) -> float:
        """Read what the process said and kill it where it has been silent for longer than a limit.

        One that starts has longer, as long as it does something. Gives its silence, seconds; 0
        where it was not killed now.
        """
        if self.running is None or self._killed:
            return 0.0
        self._listen(attended)
        silence = attended - self._heard
        if self._beat is None and silence <= max(limit_s, _START_S):
            ticks = _processor_ticks(self.running.pid)
            if ticks != self._ticks:
                self._ticks, self._worked = ticks, attended
            silence = attended - self._worked
        if silence <= limit_s:
            return 0.0
        self._killed = True
        self.running.kill()  # SIGTERM would wait for SIGCONT where it is stopped
        return silence

    def send_restarts(self, counts: Mapping[str, Mapping[str, int | str]]) -> bool:
        """Tell the process how often each ended and how last; False where to be tried again."""
        return self._link is not None and self._link.send_restarts(counts)

    def ended(self) -> End | None:
        """Say how the process ended, once; None while it runs."""
        status = self.running.poll() if self.running else None
        if status is None:
            return None
        self._listen(self._heard)  # what it said last
        why = self._link.why if self._link is not None else ""
        self.last_end = _ending(status, why, hung=self._killed)
        self.close()
        self.running = None
        end = End(status, "hung" if self._killed else "exited", self._beat is Beat.HOLDING)
        self.counts[end.reason] += 1
        return end

    def plan_restart(self, now: float, *, holding: bool = False) -> bool:
        """Set when to start again; False in a storm.

        A process that died `holding` a job counts for none: the job may be why, and the hub counts
        its attempts.
        """
        if holding:
            self.due = now + _BACKOFF_S
            return True
        self._restarts.append(now)
        while self._restarts[0] < now - _STORM_S:
            self._restarts.popleft()
        self.due = now + min(_BACKOFF_S * 2 ** (len(self._restarts) - 1), _BACKOFF_MAX_S)
        return len(self._restarts) <= _STORM_RESTARTS

    def close(self) -> None:
        """Listen no more."""
        if self._link is not None:
            self._link.close()
            self._link = None

    def _listen(self, attended: float) -> None:
        if self._link is not None and (beat := self._link.last_beat()):
            self._beat, self._heard = beat, attended


def _ending(status: int, why: str, *, hung: bool) -> str:
    if hung:
        return "it hung"
    with suppress(ValueError):
        how = f"status {status}" if status >= 0 else signal.Signals(-status).name
        return f"{how}{why and f': {why}'}"
    return f"signal {-status}"


def _processor_ticks(pid: int) -> int:
    """Give the processor time of a process, user and system; see proc(5)."""
    stat = Path(f"/proc/{pid}/stat").read_text()
    fields = stat.rpartition(")")[2].split()  # after the name, which may hold anything
    return int(fields[11]) + int(fields[12])
