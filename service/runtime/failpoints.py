"""Places where a test makes a process die, hang or find its disk full. For tests alone.

They do nothing unless the environment asks for it.
`DENSEFACE_FAILPOINTS` is a comma-separated list of `NAME=ACTION`, or `NAME=ACTION@N` for the N-th
pass alone. `DENSEFACE_FAILPOINTS_TOKENS` may name a folder: then a failpoint acts only where a file
of its name is there, which it removes first: it acts once, even if the process is started again.
Each byte in the file is for one time more.
"""

import errno
import os
import signal
import threading
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from denseface.service.errors import SettingsError

__all__ = ["ACTIONS", "FAILPOINTS_VARIABLE", "FAILPOINT_NAMES", "REMOVAL_FAILPOINTS",
           "TOKENS_VARIABLE", "arm", "failpoint"]

FAILPOINTS_VARIABLE = "DENSEFACE_FAILPOINTS"
"""Environment variable with the failpoints and their actions."""
TOKENS_VARIABLE = "DENSEFACE_FAILPOINTS_TOKENS"
"""Environment variable with the folder of tokens."""

FAILPOINT_NAMES = (
    "hub.take.sent", "capture.take.received", "capture.frame.taken", "capture.frame.sent",
    "hub.frame.received", "hub.frame.written", "hub.frame.synced", "hub.frame.named",
    "hub.frame.stored", "hub.frame.renamed", "hub.frame.acknowledged", "hub.press.acknowledged",
    "hub.attempt.counted", "hub.job.sent",
    "worker.job.received", "worker.job.computing", "worker.job.computed", "worker.result.sent",
    "hub.result.received", "hub.face.written", "hub.face.synced", "hub.face.renamed",
    "hub.face.named", "hub.outcome.stored", "hub.outcome.publishing", "hub.outcome.published",
)
"""Every step of a capture's life, in order."""
REMOVAL_FAILPOINTS = (
    "hub.removal.marked", "hub.removal.begun", "hub.removal.files", "hub.removal.rows")
"""Every step of a removal, in order."""

ACTIONS = ("kill", "stop", "hang", "raise:ENOSPC", "raise:EIO")
"""SIGKILL or SIGSTOP to this process; the thread waits for ever; an OSError like the disk's."""

_AT_DISK = ("written", "synced", "renamed")
"""Last word of the failpoints that may raise."""


@dataclass
class _Failpoint:
    action: str
    only: int | None
    """Number of the pass at which it acts; None for each."""
    token: Path | None
    passed: int = 0


_armed: dict[str, _Failpoint] = {}
_lock = threading.Lock()


def arm(environment: Mapping[str, str]) -> None:
    """Set the failpoints that the environment names, with a warning; at the start of a process.

    Raises
    ------
    SettingsError
        Where a failpoint or an action is unknown.
    """
    _armed.clear()
    text, folder = environment.get(FAILPOINTS_VARIABLE, ""), environment.get(TOKENS_VARIABLE)
    if not text:
        return
    for entry in text.split(","):
        name, _, what = entry.partition("=")
        action, at, number = what.partition("@")
        if name not in (known := FAILPOINT_NAMES + REMOVAL_FAILPOINTS):
            raise SettingsError(f"{FAILPOINTS_VARIABLE}: no failpoint {name!r}, expected one of "
                                f"{', '.join(known)}")
        possible = [one for one in ACTIONS
                    if not one.startswith("raise") or name.endswith(_AT_DISK)]
        if action not in possible:
            raise SettingsError(f"{FAILPOINTS_VARIABLE}: {name} cannot {action!r}, expected one of "
                                f"{', '.join(possible)}")
        if at and not (number.isdecimal() and int(number) > 0):
            raise SettingsError(
                f"{FAILPOINTS_VARIABLE}: {name}={what}: expected a number from 1 after @")
        _armed[name] = _Failpoint(
            action, int(number) if at else None, Path(folder, name) if folder else None)
    import structlog  # slow to import

    structlog.get_logger("failpoints").warning(
        "failpoints are set: this process is to fail", failpoints=text)


def _use_up(token: Path) -> None:
    """Take one of a token's times; FileNotFoundError where there is none."""
    more = token.stat().st_size
    if more:
        os.truncate(token, more - 1)
    else:
        token.unlink()


def failpoint(name: str) -> None:
    """Do nothing, unless `arm` set this failpoint; OSError where its action is to raise."""
    armed = _armed.get(name)
    if armed is None:
        return
    with _lock:
        armed.passed += 1
        if armed.only not in (None, armed.passed):
            return
        try:
            if armed.token:
                _use_up(armed.token)
        except FileNotFoundError:
            return
    match armed.action.split(":"):
        case ["kill"]:
            os.kill(os.getpid(), signal.SIGKILL)
        case ["stop"]:
            os.kill(os.getpid(), signal.SIGSTOP)
        case ["hang"]:
            threading.Event().wait()
        case [_, which]:
            number = getattr(errno, which)
            raise OSError(number, os.strerror(number), f"failpoint {name}")
