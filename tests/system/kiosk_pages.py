"""The kiosk of a running service, and a page without a browser."""

import json
import re
from contextlib import ExitStack, contextmanager
from pathlib import Path

import psutil
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

from denseface.service.kiosk.page_messages import FACE
from tests.nursery import Forked
from tests.system.running import REPOSITORY, Service, service
from tests.waiting import LIMIT_S, until

KIOSK = ("--kiosk-address", "0")
"""Any free port; `kiosk_url` finds it in the log."""


@contextmanager
def kiosk_service(source, folder: Path, *arguments, environment=None):
    """Run the service with a kiosk, and give it and the page's URL."""
    with service(source, folder / "data", *KIOSK, "--kiosk-folder", folder / "kiosk", *arguments,
                 environment=(environment or {}) | {"DENSEFACE_KIOSK": "on"}) as running:
        yield running, kiosk_url(running)


@contextmanager
def another_kiosk(running: Service, folder: Path, *arguments):
    """Run one more kiosk of a service, with a page of its own, and give its URL."""
    folder.mkdir()
    log = folder / "log"
    with log.open("w") as stderr:
        process = Forked(
            ["-m", "denseface", "kiosk", "--address", running.address, *KIOSK, "--kiosk-folder",
             folder / "kiosk", *arguments], cwd=REPOSITORY, stderr=stderr)
    try:
        yield _url_in(log)
        process.terminate()
        assert process.wait(LIMIT_S) == 0
    finally:
        process.close()


def kiosk_url(running: Service) -> str:
    """Wait until the newest kiosk serves, and give its URL."""
    return _url_in(running.log)


def _url_in(log: Path) -> str:
    def found() -> str | None:
        urls = re.findall(r"the page for visitors .*url=(http\S+)", log.read_text())
        return urls[-1] if urls else None

    url = until(found)
    assert url
    return url


def process_of(running: Service, name: str) -> psutil.Process:
    """Give the process of a row of the process table."""
    one, = [child for child in running.family()[1:] if name in child.cmdline()[4:5]]
    return one


class RawPage:
    """Speaks as a page does, and draws nothing."""

    def __init__(self, url: str) -> None:
        self._connected = ExitStack()
        self._socket = self._connected.enter_context(connect(
            url.replace("http", "ws", 1) + "/ws", origin=url, max_size=None, compression=None))
        self.hello = json.loads(self._socket.recv(LIMIT_S))
        self.screens: list[dict] = []
        self.faces: list[tuple[dict, bytes]] = []
        self.pictures = 0
        self.take()

    @property
    def screen(self) -> dict:
        return self.screens[-1]

    def take(self) -> None:
        """Take one message; a picture of the mirror is drawn at once."""
        message = self._socket.recv(LIMIT_S)
        if isinstance(message, str):
            self.screens.append(json.loads(message))
            return
        length = int.from_bytes(message[1:5], "little")
        head, payload = json.loads(message[5:5 + length]), message[5 + length:]
        if message[0] == FACE:
            self.faces.append((head, payload))
        else:
            assert payload.startswith(b"\xff\xd8")
            self.pictures += 1
            self.say("next")

    def say(self, kind: str, **fields: object) -> None:
        self._socket.send(json.dumps({"kind": kind, "visit": self.screen["visit"], **fields}))

    def until(self, name: str, **fields: object) -> dict:
        """Take messages until it shows a screen, and give that."""
        while self.screen["name"] != name or any(
                self.screen[key] != value for key, value in fields.items()):
            self.take()
        return self.screen

    def begin(self) -> None:
        """Begin a visit and agree."""
        self.until("attract", trouble=None)
        self.say("begin")
        self.until("consent")
        self.say("consent", agreed=True, language="en")
        self.until("position")
        self.say("next")

    def result(self) -> str:
        """Stand well until there is a face, and give the capture."""
        capture_id = self.until("result")["result"]["capture_id"]
        assert self.faces[-1][0]["capture_id"] == capture_id
        self.say("drawn", capture_id=capture_id)
        return str(capture_id)

    def close(self) -> None:
        self._connected.close()

    def __enter__(self):
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def is_closed(page: RawPage) -> bool:
    """Say whether the server ends it."""
    try:
        while True:
            page.take()
    except ConnectionClosed:
        return True
