"""Memory of each process of the service, at rest and while it makes faces, and of a browser.

    script/bench service_memory [--presses N] [--workers N ...] [--browser]

A recording is played as a live sensor, 30 frames a second, and pressed one press after the other;
who asks for hints all the while stands for the kiosk's page, by which the capture process judges
frames. PSS (proc(5), smaps_rollup) counts a page that k processes share as 1/k, so that it adds up;
USS is what would be free again if the process ended; the peak is of the resident set (VmHWM).
"""

import argparse
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import psutil

from bench.machine import describe
from bench.memory import proportional_mb
from bench.service_processes import Running, kind_of, running

__all__: list[str] = []

_RECORDING = Path("fixtures/recorded_oni/frontal_700.oni").resolve()
_REST_S = 5.0
"""At rest before and after, seconds."""
_PERIOD_S = 0.1
_ORDER = ("up", "hub", "capture", "kiosk", "worker")


@dataclass(frozen=True)
class _Used:
    """Of one process, MiB."""

    pss: float
    uss: float
    rss: float
    peak: float


def _of(process: psutil.Process) -> _Used:
    pss, uss = proportional_mb(process.pid)
    status = Path(f"/proc/{process.pid}/status").read_text().splitlines()
    peak = next(int(line.split()[1]) for line in status if line.startswith("VmHWM:"))
    return _Used(pss, uss, process.memory_info().rss / 2**20, peak / 1024)


def _sorted(service: Running) -> list[psutil.Process]:
    return sorted(service.family(), key=lambda one: (
        next(place for place, kind in enumerate(_ORDER) if kind_of(one).startswith(kind)),
        one.pid))


@contextmanager
def _watched(service: Running) -> Iterator[list[float]]:
    """Sum the PSS of all processes again and again; the first number is the largest."""
    most, ended = [0.0], threading.Event()

    def watch() -> None:
        while not ended.wait(_PERIOD_S):
            most[0] = max(most[0], sum(proportional_mb(one.pid)[0] for one in service.family()))

    def ask() -> None:
        for _ in service.client.hints():
            if ended.is_set():
                return

    threads = [threading.Thread(target=watch, daemon=True), threading.Thread(target=ask,
                                                                             daemon=True)]
    for thread in threads:
        thread.start()
    yield most
    ended.set()
    threads[0].join()


def _measure(workers: int, presses: int, flags: list[str]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        more = [*flags, "--kiosk-address", "0", "--kiosk-folder", f"{folder}/kiosk"]
        with running(f"{_RECORDING}?rate=real", workers, flags=more) as service:
            time.sleep(_REST_S)
            rest = [_of(one) for one in _sorted(service)]
            with _watched(service) as most:
                service.throughput(presses)
                time.sleep(1.0)
            time.sleep(_REST_S)
            after = [_of(one) for one in _sorted(service)]
            names = [kind_of(one) for one in _sorted(service)]
    said = " ".join(["denseface up", f"--workers {workers}", *flags])
    print(f"\n`{said}`, {presses} presses:\n\n| process | PSS at rest, MiB | PSS after | USS after "
          "| RSS after | RSS at its peak |\n| --- | --- | --- | --- | --- | --- |")
    for name, one, other in zip(names, rest, after, strict=True):
        print(f"| {name} | {one.pss:.0f} | {other.pss:.0f} | {other.uss:.0f} | {other.rss:.0f} "
              f"| {other.peak:.0f} |")
    print(f"| all | {sum(one.pss for one in rest):.0f} | {sum(one.pss for one in after):.0f} "
          f"| {sum(one.uss for one in after):.0f} | | {most[0]:.0f} (PSS) |", flush=True)


def _browser() -> None:
    """What a browser needs that shows the kiosk's page, and a face in it."""
    from tests.system.kiosk.browsing import chromium, visiting
    from tests.system.kiosk.serving import serving

    # Debian's Chromium, whose WebGL is software here.
    with (tempfile.TemporaryDirectory(prefix="df-") as folder, serving(Path(folder)) as served,
          chromium() as browser, visiting(browser, served.url, "memory", (1280, 800)) as visitor):
        visitor.at("attract")
        time.sleep(_REST_S)
        rest = _browsers_pss()
        visitor.tap("begin")
        visitor.tap("agree")
        visitor.at("result")
        visitor.seen()
        time.sleep(_REST_S)
        print(f"\nChromium {browser.version}, headless, 1280x800, all of its processes, PSS: "
              f"{rest:.0f} MiB on the first page, {_browsers_pss():.0f} with a face.")


def _browsers_pss() -> float:
    return sum(proportional_mb(one.pid)[0] for one in psutil.Process().children(recursive=True)
               if "chrom" in one.name())


def main() -> int:
    """Print a table for each number of workers and preset."""
    parser = argparse.ArgumentParser(prog="script/bench service_memory", description=__doc__)
    parser.add_argument("--presses", type=int, default=50, help="default: 50")
    parser.add_argument("--workers", type=int, nargs="+", default=[1, 2, 3], metavar="N",
                        help="default: 1 2 3")
    parser.add_argument("--browser", action="store_true",
                        help="the kiosk's page in Chromium, too (script/bootstrap --tests)")
    args = parser.parse_args()
    if min(args.presses, *args.workers) < 1:
        parser.error("--presses and --workers must be at least 1")
    print(describe(" ".join(["script/bench service_memory", *sys.argv[1:]])))
    for workers in args.workers:
        _measure(workers, args.presses, [])
    _measure(args.workers[0], args.presses, ["--preset", "light"])
    if args.browser:
        _browser()
    return 0


if __name__ == "__main__":
    sys.exit(main())
