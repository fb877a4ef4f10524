"""A process with everything imported and compiled that forks the service's processes.

A worker starts in seconds and is forked in milliseconds: a crash harness starts thousands. Lines
of JSON come in by stdin, one for each process; its id goes out by stdout.
"""

import ctypes
import json
import os
import signal
import sys
import traceback
from typing import NoReturn

from tests.nursery import die_with_the_parent

__all__: list[str] = []


def _main() -> None:
    import cv2

    from denseface.service.commands import COMMANDS, load
    from denseface.service.daemons import (
        capture,  # noqa: F401
        hub,  # noqa: F401
        worker,
    )

    cv2.setNumThreads(1)  # a thread would not live on in what is forked
    worker.warm()
    for name in COMMANDS:
        load(name)
    signal.signal(signal.SIGCHLD, signal.SIG_IGN)  # the kernel buries them
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    print("ready", flush=True)
    for line in sys.stdin:
        wanted = json.loads(line)
        child = os.fork()
        if child == 0:
            _become(wanted)
        print(child, flush=True)


def _become(wanted: dict[str, object]) -> NoReturn:
    """Be `denseface ARGUMENTS` in a group of its own, until the nursery dies."""
    status = 1
    try:
        die_with_the_parent()
        os.setpgid(0, 0)
        signal.signal(signal.SIGCHLD, signal.SIG_DFL)
        signal.signal(signal.SIGINT, signal.default_int_handler)
        log = os.open(str(wanted["log"]), os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
        null = os.open(os.devnull, os.O_RDONLY)
        for source, target in ((null, 0), (log, 1), (log, 2)):
            os.dup2(source, target)
        os.closerange(3, 256)
        environment, arguments = wanted["environment"], wanted["arguments"]
        if not isinstance(environment, dict) or not isinstance(arguments, list):
            raise TypeError("expected environment and arguments")  # noqa: TRY301
        os.environ.update(environment)
        if library := os.environ.get("LD_PRELOAD"):
            ctypes.CDLL(library).disk_faults_follow()
        from denseface.service.cli import main

        status = main(arguments)
    except SystemExit as end:
        status = end.code if isinstance(end.code, int) else 1
    except BaseException:
        traceback.print_exc()
    finally:
        print(f"ended with status {status}", file=sys.stderr, flush=True)
        os._exit(status)


if __name__ == "__main__":
    _main()
