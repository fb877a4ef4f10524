"""Each process of the service alone, as systemd starts it: when it is of use, when it hangs."""

import os
import signal
import socket
import struct
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from denseface.service.client import Client
from denseface.service.protocol import messages
from denseface.service.runtime.failpoints import FAILPOINTS_VARIABLE
from tests.ports import free_port
from tests.system.guarded import Peer
from tests.system.running import RECORDINGS, REPOSITORY
from tests.waiting import PATIENCE, until

_LIMIT_S = 2.0 * PATIENCE
"""Silence after which the stand-in for systemd takes a process for hung, seconds."""
_KEY = struct.pack("@llHHi", 1, 2, 1, 57, 1) + struct.pack("@llHHi", 1, 2, 1, 57, 0)
"""A button that is pressed: two records of `struct input_event`."""
_KIOSK_THAT_HANGS = """
import threading
from denseface.service import cli
from denseface.service.kiosk.conductor.conductor import Conductor
Conductor.button = lambda self: threading.Event().wait()
raise SystemExit(cli.main())
"""
"""A `denseface` whose kiosk's event loop stands still at a press of the button."""


@dataclass
class Manager:
    """A process, and the socket on which its service manager would listen."""

    process: "subprocess.Popen[bytes]"
    listening: socket.socket
    heard: list[str] = field(default_factory=list)
    fed_at: float = field(default_factory=time.monotonic)

    def says(self, text: str) -> bool:
        """Say whether the process has said that by now."""
        assert self.process.poll() is None
        return any(one.startswith(text) for one in self.listen())

    def listen(self) -> list[str]:
        with suppress(BlockingIOError):
            while True:
                self.heard.append(self.listening.recv(1000).decode())
                if self.heard[-1] == "WATCHDOG=1":
                    self.fed_at = time.monotonic()
        return self.heard

    def hangs(self) -> bool:
        """Look at it as systemd does, between two looks."""
        self.listen()
        return time.monotonic() - self.fed_at > _LIMIT_S


@contextmanager
def started(folder: Path, name: str, *arguments: object, program: str = "", abstract: bool = False,
            **environment: str) -> Iterator[Manager]:
    address = f"@denseface-{os.getpid()}-{name}" if abstract else f"{folder}/{name}.notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as listening:
        listening.bind(address.replace("@", "\0", 1) if abstract else address)
        listening.setblocking(False)
        process = subprocess.Popen(
            [sys.executable, *(("-c", program) if program else ("-m", "denseface")), name,
             *map(str, arguments), "--address", f"ipc://{folder}/hub"],
            cwd=REPOSITORY, stderr=subprocess.DEVNULL, env=os.environ | {
                "NOTIFY_SOCKET": address, "WATCHDOG_USEC": f"{_LIMIT_S * 1e6:.0f}",
                "WATCHDOG_PID": "1", "DENSEFACE_HEARTBEAT_S": "0.1", "DENSEFACE_LIVENESS": "100",
                "XDG_STATE_HOME": str(folder)} | environment)
        try:
            yield Manager(process, listening)
        finally:
            process.kill()
            process.wait()


@pytest.fixture
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("m")


def test_a_loop_that_hangs_says_no_more_that_it_lives_though_its_other_threads_go_on(folder):
    port = free_port()
    button = folder / "button"
    os.mkfifo(button)
    with started(folder, "hub", "--data", folder / "data", abstract=True,
                 **{FAILPOINTS_VARIABLE: "hub.job.sent=hang"}) as hub, \
            started(folder, "capture", "--source", RECORDINGS / "frontal_700.oni",
                    **{FAILPOINTS_VARIABLE: "capture.frame.sent=hang"}) as capture, \
            started(folder, "worker", abstract=True,
                    **{FAILPOINTS_VARIABLE: "worker.job.received=hang"}) as worker, \
            started(folder, "kiosk", "--kiosk-address", port, "--kiosk-button", button,
                    program=_KIOSK_THAT_HANGS) as kiosk, \
            closing(Peer(f"ipc://{folder}/hub")) as presser:
        everyone = hub, capture, worker, kiosk
        for one in everyone:
            until(lambda one=one: one.says("READY=1"))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/") as page:
            assert page.status == 200
        with Client(f"ipc://{folder}/hub") as client:
            until(lambda: client.status().workers and client.status().sensors)
            for one, status in zip(everyone, (
                    "sensors: 1, workers: 1", "streaming", "takes frames",
                    f"serves the page at http://127.0.0.1:{port}"), strict=True):
                until(lambda one=one, status=status: one.says(f"STATUS={status}"))
                until(lambda one=one: one.listen().count("WATCHDOG=1") > 2)
        presser.send(messages.Press(request=1, capture_id="press"))
        with button.open("wb", buffering=0) as pressed:
            pressed.write(_KEY)
        for one in everyone:
            until(one.hangs)
            one.process.send_signal(signal.SIGABRT)
            assert one.process.wait() == -signal.SIGABRT
            assert "STOPPING=1" not in one.listen()


def test_a_hub_that_is_told_to_end_says_so(folder):
    with started(folder, "hub", "--data", folder / "data") as hub:
        until(lambda: hub.says("READY=1"))
        hub.process.terminate()
        assert hub.process.wait() == 0
        assert hub.listen()[-1] == "STOPPING=1"
