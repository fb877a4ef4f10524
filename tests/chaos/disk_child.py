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
        case = json.loads(line)
        folder, result = Path(case["folder"]), {"told": case.get("told"), "operations": 0}
        if result["told"] is None:
            result = _in_fork(lambda: _before(shim, folder, case))  # noqa: B023
        result |= _in_fork(lambda: _after(folder, result["told"]))  # noqa: B023
        print(json.dumps(result), flush=True)


def _before(shim: ctypes.CDLL, folder: Path, case: dict[str, Any]) -> dict[str, Any]:
    events, told = Events(), []
    log = os.open(case.get("log", os.devnull), os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600)

    def tell(text: str) -> None:
        told.append(text)
        shim.disk_faults_mark(text.encode())

    events.tell = tell
    shim.disk_faults_arm(
        os.fsencode(folder), ctypes.c_long(case.get("first", -1)),
        ctypes.c_long(case.get("count", 0)), case.get("error", 0), log)
    before(folder, events)
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
        return {"told": [], "violations": [f"the process ended with {status}"]}
    result: dict[str, Any] = json.loads(text)
    return result


if __name__ == "__main__":
    main()
