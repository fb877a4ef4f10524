"""The kiosk's page in Debian's Chromium on a virtual sensor: waits, ages, frames, load, sizes.

WebGL is software here: what a machine with a graphics card does not wait for is in the figures.
"""

import argparse
import asyncio
import json
import re
import statistics
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import psutil
import websockets
from playwright.sync_api import Browser, Page

from bench.machine import describe
from tests.system.kiosk.browsing import Visitor, chromium, visiting
from tests.system.kiosk.serving import Served, serving
from tests.virtual_sensor.marks import read_mark

__all__: list[str] = []

_SIZE = (1280, 800)
_WORK_MS = 80
"""Added to each picture of the mirror, as of a slow page."""
_PERIOD_MS = 1000 / 30
_WATCH = """(work) => {
  const seen = window.seen = {ages: [], bytes: {1: [], 2: []}};
  const stamps = [];
  const Real = WebSocket;
  window.WebSocket = class extends Real {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", ({data}) => {
        if (!(data instanceof ArrayBuffer)) return;
        const view = new DataView(data);
        seen.bytes[view.getUint8(0)].push(data.byteLength);
        if (view.getUint8(0) !== 1) return;
        const head = new TextDecoder().decode(new Uint8Array(data, 5, view.getUint32(1, true)));
        stamps.push(JSON.parse(head).timestamp_us);
      });
    }
  };
  const draw = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function (...given) {
    draw.apply(this, given);
    if (!this.canvas.classList.contains("mirror") || stamps.length === 0) return;
    const now = performance.now();
    seen.ages.push([performance.timeOrigin + now, stamps.shift()]);
    while (performance.now() < now + work);
  };
}"""
"""Each picture's time of drawing and stamp; the size of each binary message."""
_PUSHED = """<!doctype html><meta charset="utf-8"><canvas class="mirror"></canvas><script>
const socket = new WebSocket(`ws://${location.host}/`);
socket.binaryType = "arraybuffer";
const context = document.querySelector("canvas").getContext("2d");
socket.onmessage = async ({data}) => {
  const from = 5 + new DataView(data).getUint32(1, true);
  context.drawImage(await createImageBitmap(new Blob([data.slice(from)])), 0, 0);
};
</script>"""
"""The peer: whatever comes is drawn, and nothing is asked for."""
_HEAP = "() => { gc(); return performance.memory.usedJSHeapSize; }"
_FRAMES = """(seconds) => new Promise((done) => {
  let count = 0;
  const begun = performance.now();
  const canvas = document.querySelector("canvas.face");
  const step = () => {
    count += 1;
    canvas.dispatchEvent(new WheelEvent("wheel", {deltaY: count % 2 ? 1 : -1, bubbles: true}));
    if (performance.now() < begun + 1000 * seconds) requestAnimationFrame(step);
    else done(1000 * count / (performance.now() - begun));
  };
  requestAnimationFrame(step);
})"""


def _percentiles(values: list[float], *wanted: float) -> str:
    return " / ".join(f"{np.percentile(values, one):,.0f}" for one in wanted)


def _to_result(visitor: Visitor) -> None:
    visitor.at("attract")
    visitor.tap("begin")
    visitor.tap("agree")
    visitor.at("result")
    visitor.seen()


def _visits(browser: Browser, served: Served, count: int) -> Iterator[str]:
    """Whole visits: the wait for the mesh, the server's processor time, what came in bytes."""
    kiosk = served.process("kiosk")
    before = sum(kiosk.cpu_times()[:2])
    with visiting(browser, served.url, "bench", _SIZE) as visitor:
        visitor.page.add_init_script(f"({_WATCH})(0)")
        visitor.page.goto(served.url)
        memory, heap = [], []
        for _ in range(count):
            _to_result(visitor)
            visitor.tap("done")
            visitor.tap("done")
            visitor.at("thanks", "attract")
            memory.append(kiosk.memory_info().rss / 2**20)
            visitor.page.evaluate("() => { seen.ages = []; seen.bytes[1] = []; }")  # not its own
            heap.append(visitor.page.evaluate(_HEAP) / 2**20)
        visitor.at("attract")
        spent = (sum(kiosk.cpu_times()[:2]) - before) / count
        faces = visitor.page.evaluate("seen.bytes[2]")
    waits = [float(one) for one in re.findall(
        r"exposure_to_drawn_ms=(\d+)", served.up.log.read_text())][-count:]
    yield f"| exposure to first mesh on the screen, p50 / p99, ms | {_percentiles(waits, 50, 99)} |"
    yield f"| processor time of the kiosk's process, a visit, s | {spent:.2f} |"
    yield ("| its memory after the tenth and the last visit, MB "
           f"| {memory[min(9, count - 1)]:.0f} / {memory[-1]:.0f} |")
    yield ("| the page's heap after the tenth and the last visit, MB "
           f"| {heap[min(9, count - 1)]:.1f} / {heap[-1]:.1f} |")
    yield f"| a face as it is sent, kB | {statistics.fmean(faces) / 1e3:.0f} |"


def _clock_offset_ms(served: Served) -> float:
    """Give what makes a sensor's stamp, in ms, the time of day of the exposure."""
    with served.client() as client:
        for preview in client.previews():
            exposed_ms = read_mark(preview.image).exposed_ns / 1e6
            return exposed_ms + 1e3 * (time.time() - time.monotonic()) - preview.timestamp_us / 1e3
    raise RuntimeError("the hub is gone")


def _ages(page: Page, offset_ms: float) -> tuple[list[float], float]:
    """Give the ages of the pictures when they were drawn, and how much they grew, ms."""
    drawn = page.evaluate("seen.ages")
    ages = [at - stamp / 1e3 - offset_ms for at, stamp in drawn]
    third = max(len(ages) // 3, 1)
    return ages, statistics.median(ages[-third:]) - statistics.median(ages[:third])


def _row(name: str, ages: list[float], grown: float) -> str:
    return (f"| {name} | {_percentiles(ages, 50, 95)} "
            f"({np.percentile(ages, 95) / _PERIOD_MS:.1f} periods), {grown:+,.0f} from the first "
            f"third to the last, {len(ages)} pictures |")


def _mirror(browser: Browser, served: Served, seconds: float) -> Iterator[str]:
    offset = _clock_offset_ms(served)
    for name, work in (("idle", 0), (f"with {_WORK_MS} ms of work a picture", _WORK_MS)):
        with visiting(browser, served.url, "bench", _SIZE) as visitor:
            visitor.page.add_init_script(f"({_WATCH})({work})")
            visitor.page.goto(served.url)
            visitor.at("attract")
            visitor.tap("begin")
            visitor.tap("agree")
            _stay(visitor, seconds)
            yield _row(f"age of the mirror's picture when drawn, {name}, p50 / p95, ms",
                       *_ages(visitor.page, offset))
    with _pushing(served) as url, visiting(browser, url, "bench", _SIZE) as visitor:
        visitor.page.add_init_script(f"({_WATCH})({_WORK_MS})")
        visitor.page.goto(url)
        visitor.page.wait_for_timeout(1000 * seconds)
        yield _row(f"the same if the server pushes, with {_WORK_MS} ms of work",
                   *_ages(visitor.page, offset))


def _stay(visitor: Visitor, seconds: float) -> None:
    """Stay before the mirror: somebody touches the screen now and then."""
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        visitor.page.mouse.move(300 + time.monotonic() % 5, 300)
        visitor.page.wait_for_timeout(2000)


@contextmanager
def _pushing(served: Served) -> Iterator[str]:
    """Serve a page to which every picture is pushed."""
    loop, ready = asyncio.new_event_loop(), threading.Event()
    ports: list[int] = []

    async def push(socket: websockets.ServerConnection) -> None:
        from denseface.service.client import AsyncClient  # of this loop alone
        async with AsyncClient(served.up.address) as client:
            # A page that goes away ends it.
            with suppress(websockets.ConnectionClosed):
                async for preview in client.previews():
                    head = json.dumps({"timestamp_us": preview.timestamp_us}).encode()
                    await socket.send(
                        b"\1" + len(head).to_bytes(4, "little") + head + (preview.jpeg or b""))

    def page(connection: websockets.ServerConnection, request: websockets.Request) -> object:
        if request.headers.get("Upgrade"):
            return None
        answer = connection.respond(200, _PUSHED)
        del answer.headers["Content-Type"]
        answer.headers["Content-Type"] = "text/html"
        return answer

    async def serve() -> None:
        async with websockets.serve(push, "127.0.0.1", 0, process_request=page) as server:
            ports.append(server.sockets[0].getsockname()[1])
            ready.set()
            await asyncio.Future()

    task = loop.create_task(serve())
    thread = threading.Thread(target=lambda: _run(loop, task))
    thread.start()
    ready.wait()
    yield f"http://127.0.0.1:{ports[0]}/"
    loop.call_soon_threadsafe(task.cancel)
    thread.join()


def _run(loop: asyncio.AbstractEventLoop, task: "asyncio.Task[None]") -> None:
    try:
        loop.run_until_complete(task)
    except asyncio.CancelledError:
        loop.close()


def _viewer(browser: Browser, served: Served, seconds: float) -> Iterator[str]:
    with visiting(browser, served.url, "bench", _SIZE) as visitor:
        _to_result(visitor)
        points = visitor.page.locator(".facts p").first.inner_text()
        rate = visitor.page.evaluate(_FRAMES, seconds)
        yield f"| frames a second while the face is moved, software WebGL ({points}) | {rate:.1f} |"


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(prog="script/bench kiosk", description=__doc__)
    parser.add_argument("--visits", type=int, default=30, help="(%(default)s)")
    parser.add_argument("--seconds", type=float, default=60.0,
                        help="before the mirror (%(default)s)")
    args = parser.parse_args()
    print(describe(" ".join(["script/bench kiosk", *sys.argv[1:]])))
    print(f"\nPage of {_SIZE[0]}x{_SIZE[1]}, {psutil.cpu_count()} cores for browser and service:\n")
    print("| what | |\n| --- | --- |")
    with tempfile.TemporaryDirectory() as folder, chromium() as browser:
        with serving(Path(folder), "--kiosk-countdown", "0") as served:
            for row in _visits(browser, served, args.visits):
                print(row, flush=True)
            for row in _viewer(browser, served, 10):
                print(row, flush=True)
        away = Path(folder) / "mirror"
        away.mkdir()
        with serving(away, "--kiosk-auto", "off", marks=True) as served:
            for row in _mirror(browser, served, args.seconds):
                print(row, flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
