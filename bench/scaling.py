"""How far `denseface batch` carries: what a task costs here, and a simulated schedule of many.

`script/bench scaling` prints the tables of docs/scaling.md and of docs/benchmarks.md.
"""

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil

from bench.machine import describe
from bench.scaling_simulation import Costs, Fleet, Outcome, simulate, sized

__all__ = ["main"]

_RECORDING = Path(__file__).parent.parent / "fixtures/recorded_oni/frontal_700.oni"
_ROWS, _ROW_BYTES = 16, 2200
"""Of a task's answer: 16 rows, each with its picture."""
_TRIES = 1200
"""Tasks that do nothing, to see what they cost."""
_PURE_S = (0.002, 0.01, 0.02, 0.05, 0.1, 0.35)
"""Tasks that only wait, to see whether the simulation says how long many of them take."""


def main() -> None:
    """Measure, simulate, print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frame-ms", type=float, metavar="MS",
                        help="time of a frame on a worker, instead of the one measured")
    args = parser.parse_args()
    print(describe("script/bench scaling", "distributed " + _version("distributed")), "\n")
    frame_s = _frame()
    if args.frame_ms:
        frame_s = args.frame_ms / 1000
    row_s = _row()
    with tempfile.TemporaryDirectory() as folder, _cluster(Path(folder)) as (client, processes):
        costs = _costs(client, processes, row_s)
        _compare(client, costs)
    _tables(costs, frame_s)


def _version(name: str) -> str:
    from importlib.metadata import version

    return version(name)


def _cpu(call: Callable[[], object], times: int) -> float:
    """Give the processor's time of a call, seconds: the least of several."""
    call()
    found = []
    for _ in range(times):
        begun = time.process_time()
        call()
        found.append(time.process_time() - begun)
    return min(found)


def _frame() -> float:
    """Say what a frame costs, part by part, and give the sum, seconds."""
    from denseface import load_frame, save_face, save_frame
    from denseface.capture import open_source
    from denseface.recon import reconstruct
    from denseface.service.tools.batch.summary.thumbnail import thumbnail

    with open_source(str(_RECORDING)) as source:
        frame = next(iter(source))
    face = reconstruct(frame)
    with tempfile.TemporaryDirectory() as name:
        npz, out = Path(name, "frame.npz"), Path(name, "face.ply")
        save_frame(frame, npz)
        parts = {
            "read a frame (.npz)": _cpu(lambda: load_frame(npz), 7),
            "reconstruct": _cpu(lambda: reconstruct(frame), 15),
            "thumbnail": _cpu(lambda: thumbnail(face), 15),
            "write the face (.ply)": _cpu(lambda: save_face(face, out), 7),
        }
        packed_s = _cpu(lambda: save_face(face, Path(name, "face.npz")), 5)
        sizes = npz.stat().st_size, out.stat().st_size
    print("| of one frame | processor, ms |\n| --- | ---: |")
    for name, seconds in parts.items():
        print(f"| {name} | {1000 * seconds:.1f} |")
    total = sum(parts.values())
    print(f"| all | {1000 * total:.1f} |\n\nframe {sizes[0]:,} bytes, face {sizes[1]:,} bytes, "
          f"{len(face.dense):,} points; a face as .npz takes {1000 * packed_s:.0f} ms\n")
    return total


def _row() -> float:
    """Give what a row costs whoever gathers it, seconds."""
    from denseface.service.tools.batch.row import Row
    from denseface.service.tools.batch.summary.progress import BatchProgress
    from denseface.service.tools.batch.summary.writer import SummaryWriter

    picture = b"\xff\xd8\xff" + np.random.default_rng(0).bytes(2000)
    rows = [Row(source=f"visits/{number // 500:06}.oni", frame=number % 500, state="face",
                output=f"faces/{number:06}.npz", dense=148_000, measured=14_000, sigma_mm=0.5,
                mean_spacing_mm=1.2, noise_mm=1.0, face_score=0.9, seconds=0.1, worker="a",
                thumbnail=picture).as_dict() for number in range(20_000)]
    progress = BatchProgress(len(rows))
    with tempfile.TemporaryDirectory() as name:
        begun = time.process_time()
        with SummaryWriter(Path(name)) as summary:
            for at in range(0, len(rows), _ROWS):
                some = [Row.from_dict(row) for row in rows[at:at + _ROWS]]
                summary.add(*some)
                for row in some:
                    progress.add(row)
        taken = (time.process_time() - begun) / len(rows)
        size = (Path(name) / "summary.parquet").stat().st_size / len(rows)
    print(f"A row: {1000 * taken:.3f} ms of the client's processor, {size:,.0f} bytes.\n")
    return taken


@contextmanager
def _cluster(folder: Path) -> Iterator[tuple[Any, dict[str, list[psutil.Process]]]]:
    """Run a scheduler and two workers as processes, with TLS as `denseface batch` does."""
    from distributed import Client
    from distributed.security import Security

    security = Security.temporary()
    for role in ("scheduler", "worker", "client"):
        for kind in ("key", "cert"):
            path = folder / f"{role}.{kind}"
            path.write_text(getattr(security, f"tls_{role}_{kind}"))
    (folder / "ca").write_text(security.tls_ca_file)
    places = folder / "scheduler.json"

    def start(role: str, *more: str) -> psutil.Process:
        command = [sys.executable, "-m", "dask", role, "--scheduler-file", str(places),
                   "--no-dashboard", "--protocol", "tls", "--tls-ca-file", str(folder / "ca"),
                   "--tls-cert", str(folder / f"{role}.cert"),
                   "--tls-key", str(folder / f"{role}.key"), *more]
        with (folder / f"{role}.log").open("ab") as log:
            return psutil.Popen(command, stdout=log, stderr=log, env=os.environ)

    with ExitStack() as opened:
        scheduler = start("scheduler", "--host", "127.0.0.1", "--port", "0")
        opened.callback(_end, scheduler)
        workers = []
        for _ in range(2):
            workers.append(start(
                "worker", "--nthreads", "1", "--no-nanny", "--host", "127.0.0.1",
                "--local-directory", str(folder)))
            opened.callback(_end, workers[-1])
        while not places.exists():
            if scheduler.poll() is not None:
                raise SystemExit((folder / "scheduler.log").read_text()[-2000:])
            time.sleep(0.1)
        own = Security(tls_ca_file=str(folder / "ca"), tls_client_cert=str(folder / "client.cert"),
                       tls_client_key=str(folder / "client.key"), require_encryption=True)
        client = opened.enter_context(Client(scheduler_file=str(places), security=own))
        client.wait_for_workers(2, timeout=120)
        yield client, {"scheduler": [scheduler], "worker": workers, "client": [psutil.Process()]}


def _end(process: psutil.Process) -> None:
    process.terminate()
    process.wait(30)


def _task(number: int, seconds: float, size: int) -> bytes:
    """Wait, and answer with so many bytes that are not like another's."""
    time.sleep(seconds)
    return number.to_bytes(8, "big") + bytes(size)


def _run(client: Any, times_s: Sequence[float], window: int, size: int) -> float:
    """Do tasks, a few at a time, as the command does; give the time, seconds."""
    from distributed import as_completed

    begun = time.perf_counter()
    following = iter(enumerate(times_s))
    first = [client.submit(_task, number, one, size, pure=False)
             for number, one in (next(following) for _ in range(min(window, len(times_s))))]
    done = as_completed(first, with_results=True)
    del first
    for future, answer in done:
        if len(answer) != size + 8:
            raise RuntimeError("a task gave another answer")
        future.release()
        if (more := next(following, None)) is not None:
            done.add(client.submit(_task, *more, size, pure=False))
    return time.perf_counter() - begun


def _costs(client: Any, processes: dict[str, list[psutil.Process]], row_s: float) -> Costs:
    """Measure what tasks cost that do nothing."""
    size = _ROWS * _ROW_BYTES
    _run(client, [0.0] * 100, 4, size)
    before = _processor(processes)
    wall_s = _run(client, [0.0] * _TRIES, 4, size)
    spent = {name: (now - before[name]) / _TRIES for name, now in _processor(processes).items()}
    # One at a time nobody waits for another: what is left of the time is the way.
    alone_s = _run(client, [0.0] * 300, 1, size) / 300
    way_s = max(0.0, alone_s - sum(spent.values())) / 4
    print(f"A task that does nothing, with an answer of {size:,} bytes, over TLS: "
          f"{_TRIES / wall_s:.0f} a second on two workers, {1000 * alone_s:.1f} ms alone; "
          "processor " + ", ".join(f"{name} {1000 * one:.2f} ms" for name, one in spent.items())
          + ".\n")
    return Costs(spent["scheduler"], spent["client"], row_s, spent["worker"], way_s)


def _processor(processes: dict[str, list[psutil.Process]]) -> dict[str, float]:
    return {name: sum(sum(one.cpu_times()[:2]) for one in some)
            for name, some in processes.items()}


def _compare(client: Any, costs: Costs) -> None:
    """Hold the simulation against tasks of known times on two workers."""
    plain = replace(costs, client_row=0.0)
    print("| tasks, spread 30 % | found, s | simulated, s | error |\n| --- | ---: | ---: | ---: |")
    for mean_s in _PURE_S:
        number = max(60, min(600, round(12 / mean_s)))
        times_s = np.maximum(0.0, np.random.default_rng(1).normal(
            mean_s, 0.3 * mean_s, number)).tolist()
        found_s = _run(client, times_s, 4, _ROWS * _ROW_BYTES)
        said = simulate(Fleet(2, mean_s, frames_a_task=1), plain, number, times_s=times_s,
                        cores=os.cpu_count() or 1)
        print(f"| {number} of {1000 * mean_s:g} ms | {found_s:.2f} | {said.seconds:.2f} | "
              f"{100 * (said.seconds / found_s - 1):+.0f} % |")
    print()


def _tables(costs: Costs, frame_s: float) -> None:
    """Say which part is full first, and what helps."""
    usual = sized(Fleet(1, frame_s), 0.35)
    cases: list[tuple[str, Fleet, Costs]] = [
        (f"{workers:,} workers", replace(usual, workers=workers), costs)
        for workers in (2, 10, 30, 100, 300, 1000)]
    many = replace(usual, workers=300)
    longer = sized(many, 5.0)
    cases += [
        ("300, tasks of 5 s", longer, costs),
        ("300, tasks of 5 s, rows kept by the workers", longer, replace(costs, client_row=0.0)),
        ("1,000, the same", replace(longer, workers=1000), replace(costs, client_row=0.0)),
        ("30, one in ten three times slower", replace(usual, workers=30, slow_share=0.1), costs),
        ("30, each dies once an hour", replace(usual, workers=30, dies_each_s=3600), costs),
        ("30, one frame a task", replace(usual, workers=30, frames_a_task=1), costs),
    ]
    print("| | frames a task | frames a second | of what the workers could | scheduler busy | "
          "client busy |\n| --- | ---: | ---: | ---: | ---: | ---: |")
    for name, fleet, paid in cases:
        found = _settled(fleet, paid)
        speed = found.steady * fleet.workers / fleet.frame_s
        print(f"| {name} | {fleet.frames_a_task} | {speed:,.0f} | {100 * found.steady:.0f} % | "
              f"{100 * found.scheduler:.0f} % | {100 * found.client:.0f} % |")
    tasks_s = 1 / max(costs.scheduler, costs.client + usual.frames_a_task * costs.client_row)
    print(f"\nThe scheduler passes on {1 / costs.scheduler:,.0f} tasks a second, the client takes "
          f"{1 / (costs.client + usual.frames_a_task * costs.client_row):,.0f}: the lesser of both "
          f"keeps {tasks_s * usual.frames_a_task * frame_s:,.0f} workers busy.")


def _settled(fleet: Fleet, costs: Costs) -> Outcome:
    return simulate(fleet, costs, max(400, 40 * fleet.workers))


if __name__ == "__main__":
    main()
