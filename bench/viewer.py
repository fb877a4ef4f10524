"""What a face weighs on its way to a browser, and what it costs there: `script/bench viewer`."""

import argparse
import statistics
import tempfile
import zlib
from pathlib import Path

import psutil
from playwright.sync_api import Page

from bench.accuracy import RECORDINGS
from bench.machine import describe
from bench.own import milliseconds
from denseface.capture import open_source
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.face import Face
from denseface.service.export.face_grid import encode_face_grid
from tests.face_grid_reader import read_face_grid
from tests.viewer_page import serving_page, software_browser

__all__ = ["payload_table", "viewer_table"]

_RUNS = 9
_FRAMES = 7
_TURN_S = 6.0
_SIZE = {"width": 1280, "height": 800}
_SHOWN = "frontal_700"
"""148,222 points."""


def faces() -> dict[str, Face]:
    """Reconstruct the first frame of each recording that has a face."""
    made = {}
    for path in sorted(RECORDINGS.glob("*.oni")):
        with open_source(path) as source:
            try:
                made[path.stem] = reconstruct(next(iter(source)))
            except ReconstructionError:
                continue
    return made


def payload_table(given: dict[str, Face]) -> str:
    """Size, error and time of `encode_face_grid` for each face."""
    lines = ["| recording | points, dense | initial | raw, MB | sent, MB | encoded in, ms "
             "| z off by at most, mm | sigma, % |",
             "| --- | --- | --- | --- | --- | --- | --- | --- |"]
    for name, face in given.items():
        data = encode_face_grid(face)
        raw = len(zlib.decompress(data[12 + int.from_bytes(data[8:12], "little"):]))
        ms = statistics.median(milliseconds(lambda face=face: encode_face_grid(face))  # type: ignore[misc]
                               for _ in range(_RUNS))
        read = read_face_grid(data)
        off = abs(read.points[:, 2] - face.dense.points[:, 2]).max()
        sigma = abs(read.sigma / face.dense.sigma - 1).max()
        lines.append(f"| {name} | {len(face.dense):,} | {len(face.initial):,} | {raw / 1e6:.2f} "
                     f"| {len(data) / 1e6:.3f} | {ms:.1f} | {off:.4f} | {100 * sigma:.2f} |")
    return "\n".join(lines)


def _browser_ms() -> float:
    """Processor's time of all of the browser's processes so far."""
    total = 0.0
    for process in psutil.Process().children(recursive=True):
        try:
            if "--type=" in " ".join(process.cmdline()):
                times = process.cpu_times()
                total += 1e3 * (times.user + times.system)
        except psutil.NoSuchProcess:
            continue
    return total


def _draw_row(page: Page, what: str, stride: int, mode: str, ratio: float) -> str:
    before = _browser_ms()
    wall = page.evaluate("(given) => page.drawMs(...given)",
                         ["shown.face", stride, mode, ratio, _FRAMES])
    used = (_browser_ms() - before) / (_FRAMES + 1)
    return f"| {what} | {wall:.0f} | {used:.0f} |"


def viewer_table(face: Face) -> str:
    """What the viewer takes in Chromium without a graphics card, 1280 x 800."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "shown.face").write_bytes(encode_face_grid(face))
        with serving_page(folder) as url, software_browser() as browser:
            page = browser.new_page(viewport=_SIZE)  # type: ignore[arg-type]
            page.goto(url)
            decoded, made, joined = page.evaluate(f"page.readyMs('shown.face', {_RUNS})")
            rows = [_draw_row(page, *case) for case in (
                ("every point, 1.5 pixels for each: when still", 1, "mesh", 1.5),
                ("every point", 1, "mesh", 1.0),
                ("every second row and column: while it moves", 2, "mesh", 1.0),
                ("every third: where that is slow", 3, "mesh", 1.0),
                ("points view", 2, "points", 1.0))]
            rate = page.evaluate(f"page.turnFor('shown.face', {_TURN_S})")
            browser_version = browser.version
    return "\n".join([
        f"Chromium {browser_version}, SwiftShader, {_SIZE['width']} x {_SIZE['height']}, "
        f"{len(face.dense):,} points: bytes to grid {decoded:.0f} ms, grid to vertices "
        f"{made:.0f} ms, to triangles {joined:.0f} ms (medians of {_RUNS}). Turning by itself "
        f"{rate:.0f} pictures a second, of at most 22.", "",
        "| a picture of | until it is there, ms | processor's time, ms |", "| --- | --- | --- |",
        *rows])


def main() -> None:
    """Print both tables."""
    argparse.ArgumentParser(prog="script/bench viewer", description=__doc__).parse_args()
    print(describe("script/bench viewer"))
    made = faces()
    print(f"\n{payload_table(made)}\n\n{viewer_table(made[_SHOWN])}")


if __name__ == "__main__":
    main()
