"""The operator's page with an example hub behind it.

`python -m tests.operator_states` serves the built page and says where, and the token.
"""

import asyncio
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from denseface.service.kiosk.operator.desk import Desk
from denseface.service.kiosk.operator.page import OperatorPage
from denseface.service.kiosk.operator.token import OperatorToken
from denseface.service.kiosk.web.app import kiosk_app, kiosk_files
from denseface.service.kiosk.web.guard import origins_of
from denseface.service.kiosk.web.server import bind, serve
from denseface.service.protocol.message_base import CaptureSummary
from denseface.service.protocol.status import SensorStatus
from tests.unit.service.kiosk.operator.desk import STATUS, Hub
from tests.waiting import LIMIT_S

_STATISTICS = {
    "seconds": {"good": 41.2, "come_closer": 63.4, "hold_still": 30.1, "more_light": 12.0,
                "nobody": 7.5},
    "visits": 37, "captures": 31, "faces": 30, "kept": 9, "positioning_s": 142.0,
    "ends": {"done": 22, "declined": 3, "cancelled": 4, "left": 5, "deleted": 3}, "failures": {}}


class ExampleHub(Hub):
    """A hub of which more can be shown."""

    def __init__(self) -> None:
        super().__init__()
        self.status_now = STATUS.model_copy(update={"sensor_states": (
            SensorStatus(name="kiosk/412", state="streaming", identity="Orbbec Astra 18030620056"),
            SensorStatus(name="kiosk/413", state="absent", reason="no such device is plugged in",
                         identity="USB 1-4"))})
        self.letters = True
        self.rows = [("capture-1", "done", None), ("capture-2", "done", None),
                     ("capture-3", "failed", "NoFaceError"), ("capture-4", "working", None),
                     *((f"older-{n}", "failed", "NoFaceError") for n in range(10))]

    async def status(self, **_: float) -> Any:
        await super().status()
        return self.status_now

    async def captures(self, last: int = 20, **_: float) -> Any:
        await super().captures(last)
        return tuple(
            CaptureSummary(capture_id=name, sequence=100 - n, state=state, error=error, attempts=1,
                           accepted_at=f"2026-11-29T12:{59 - 3 * n:02}:{7 * n % 60:02}Z")
            for n, (name, state, error) in enumerate(self.rows))[:last]

    async def purge(self, *, capture_id: str | None = None, **_: float) -> int:
        self.rows = [row for row in self.rows if row[0] != capture_id]
        return await super().purge(capture_id=capture_id)

    async def dead(self, **_: float) -> Any:
        async for letter in super().dead():
            if self.letters:
                yield letter

    async def drop(self, capture_id: str, **_: float) -> None:
        await super().drop(capture_id)
        self.letters = False


class Operated:
    """A kiosk with an operator's page."""

    def __init__(self, folder: Path) -> None:
        self.hub = ExampleHub()
        self.kiosk: dict[str, Any] = {
            "version": "0.1.0", "consent": True, "links": "192.168.1.20:8090", "links_tls": False,
            "reserve_bytes": 2**28}
        self.statistics: dict[str, Any] = dict(_STATISTICS)
        self.forgotten: list[str] = []
        self._token = OperatorToken(folder / "kiosk")
        self.secret = self._token.renew()
        self.url = ""
        self.listening = threading.Event()

    async def serve(self, port: int, stop: threading.Event) -> None:
        """Serve until told to stop."""
        async def forget(capture_id: str) -> None:
            self.forgotten.append(capture_id)

        async def no_page(socket: Any) -> None:
            await socket.close()

        files = kiosk_files()
        bound = await bind(("127.0.0.1", port), "--kiosk-address")
        port = bound.getsockname()[1]
        desk = Desk(self.hub, self.kiosk, lambda: self.statistics, forget)
        page = OperatorPage(desk, self._token, files, time.monotonic)
        app = kiosk_app(
            no_page, origins_of("http", "127.0.0.1", port), files, page.routes())
        self.url = f"http://127.0.0.1:{port}/operator"
        serving = asyncio.create_task(serve(app, bound))
        self.listening.set()
        while not stop.is_set():
            await asyncio.sleep(0.02)
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)


@contextmanager
def serving_operator(port: int = 0) -> Iterator[Operated]:
    """Serve the page on a free port of the loopback; yield what is behind it."""
    with TemporaryDirectory() as folder:
        operated, stop = Operated(Path(folder)), threading.Event()
        thread = threading.Thread(target=lambda: asyncio.run(operated.serve(port, stop)))
        thread.start()
        try:
            assert operated.listening.wait(LIMIT_S)
            yield operated
        finally:
            stop.set()
            thread.join(LIMIT_S)


if __name__ == "__main__":
    with serving_operator(int(sys.argv[1]) if len(sys.argv) > 1 else 0) as running:
        sys.stdout.write(f"{running.url}\n{running.secret}\n")
        sys.stdout.flush()
        threading.Event().wait()
