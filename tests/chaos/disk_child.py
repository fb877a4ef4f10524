"""A process whose file operations can be made to fail: for each case it forks, so all start warm.

Cases come as lines of JSON, what became of them goes back in the same way (`tests.chaos.disk`).
"""

import ctypes
import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import structlog

from tests.chaos.disk_history import Events, after, before
from tests.chaos.history import violations

_LIMIT_S = 60
"""Longest time of a case."""


def main() -> None:
    """Play cases until there are no more."""
    structlog.configure(logger_factory=structlog.ReturnLoggerFactory())  # stdout is for results
    shim = ctypes.CDLL(os.environ["LD_PRELOAD"])
    shim.disk_faults_disarm.restype = ctypes.c_long
    for line in sys.stdin:
        print(json.dumps(_play(shim, json.loads(line))), flush=True)


def _play(shim: ctypes.CDLL, case: dict[str, Any]) -> dict[str, Any]:
    """Let one hub after the other live on its disk, and then one on a sound disk."""
    folder, told, found, operations = Path(case["folder"]), case.get("told", []), [], 0
    hubs = case.get("hubs", [])
    for number, faults in enumerate(hubs):
        stops = number == len(hubs) - 1
        result = _in_fork(lambda: _before(shim, folder, told, faults, number, stops))  # noqa: B023
        told, operations = result["told"], result["operations"]
        found += result["violations"]
    found += _in_fork(lambda: _after(folder, told))["violations"]
    return {"operations": operations, "violations": found}


def _before(
    shim: ctypes.CDLL, folder: Path, told: list[str], faults: dict[str, Any], hub: int, stops: bool
) -> dict[str, Any]:
    events = Events.of(told)
    log = os.open(faults.get("log", os.devnull), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)

    def tell(text: str) -> None:
        told.append(text)
        shim.disk_faults_mark(text.encode())

    events.tell = tell
    shim.disk_faults_arm(
        os.fsencode(folder), ctypes.c_long(faults.get("first", -1)),
        ctypes.c_long(faults.get("count", 0)), faults.get("error", 0), log)
    before(folder, events, hub, stops=stops)
    operations = shim.disk_faults_disarm()
    return {"told": told, "operations": operations, "violations": events.faults}


def _after(folder: Path, told: list[str]) -> dict[str, Any]:
    events = Events.of(told)
    try:
        found = violations(after(folder, events))
    except Exception as error:
        return {"violations": [f"the next hub: {error!r}"]}
    return {"violations": [*events.faults, *found]}


def _in_fork(action: Callable[[], dict[str, Any]]) -> dict[str, Any]:
    """Give the result of an action of a process of its own, which ends as if it were killed."""
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        signal.alarm(_LIMIT_S)
        os.write(writer, json.dumps(action()).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader, "rb") as file:
        text = file.read()
    _, status = os.waitpid(child, 0)
    if not text:
        return {"told": [], "operations": 0, "violations": [f"a hub's process ended: {status}"]}
    result: dict[str, Any] = json.loads(text)
    return result


if __name__ == "__main__":
    main()
