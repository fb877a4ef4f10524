"""An archive on Dask beside a plain pool of processes and the bare function; and its memory.

The engines are given the same sources by the same schedule; all workers are warm before the clock
runs. By turns: what else runs on the machine slows all three.
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from itertools import islice
from pathlib import Path
from statistics import median

import psutil

from bench.machine import describe
from denseface.service.tools.batch.engines.clusters import local_engine
from denseface.service.tools.batch.engines.engine import Done, Engine
from denseface.service.tools.batch.losses import Losses
from denseface.service.tools.batch.parts import Part, Task
from denseface.service.tools.batch.plan import Plan
from denseface.service.tools.batch.row import Row
from denseface.service.tools.batch.schedule import Schedule
from denseface.service.tools.batch.worker.work import run_task
from denseface.service.tools.frames import FrameChoice
from tests.unit.service.tools.batch.pools import PoolEngine

__all__: list[str] = []

RECORDINGS = Path(__file__).resolve().parents[1] / "fixtures" / "recorded_oni"
_FRAMES_EACH = 3
_WARM = 24
"""Recordings that are done before the clock runs."""
_BARE = """
import sys, time
from bench.batch import bare
bare(int(sys.argv[1]), sys.argv[2], sys.argv[3], float(sys.argv[4]))
"""


def _sources(archive: Path, recordings: int) -> Iterator[Part]:
    """Give a folder's recordings again and again, each time under other names."""
    paths = sorted(archive.glob("*.oni"))
    for at in range(recordings):
        yield Part(str(paths[at % len(paths)]), f"{at:06}", many=True)


def _plan() -> str:
    return Plan(FrameChoice(10**7)).to_json()


class _Watched:
    """An engine, and how long its workers worked."""

    def __init__(self, engine: Engine) -> None:
        self._engine, self.submit, self.close = engine, engine.submit, engine.close
        self.worked_s = 0.0

    @property
    def width(self) -> int:
        return self._engine.width

    def completed(self) -> Iterator[Done]:
        for done in self._engine.completed():
            self.worked_s += done.answer["seconds"] if done.answer else 0.0
            yield done


def _run(engine: Engine, archive: Path, out: Path, recordings: int) -> tuple[int, float]:
    """Do so many recordings; give the frames, and the seconds that they took."""
    out.mkdir(exist_ok=True)
    done: list[int] = []

    def gather(rows: list[Row], _: list[Row]) -> None:
        done.append(len(rows))

    begun_s = time.perf_counter()
    Schedule(engine, Task(str(out), _plan(), [], 0, 0.0, 120.0), _sources(archive, recordings),
             Losses(out), gather).run()
    taken_s = time.perf_counter() - begun_s
    shutil.rmtree(out)
    return sum(done), taken_s


def bare(recordings: int, archive: str, out: str, start_at: float) -> None:
    """Do what a worker does, in this process alone, one task after the other."""
    for path, number in (("warm", _WARM // 4), ("timed", recordings)):
        folder = Path(out) / path
        folder.mkdir(parents=True)
        sources = _sources(Path(archive), number)
        if path == "timed":
            time.sleep(max(0.0, start_at - time.time()))
        begun_s, frames = time.perf_counter(), 0
        while some := list(islice(sources, 2)):
            answer = run_task(Task(str(folder), _plan(), some, 99, 1e9, 120.0).to_plain())
            frames += len(answer["rows"])
        taken_s = time.perf_counter() - begun_s
    print(frames, taken_s, flush=True)


def _bare_on_all_cores(cores: int, archive: Path, out: Path, recordings: int) -> float:
    """Give frames a second of the bare function, in so many processes that know no other."""
    start_at = time.time() + 20
    running = [subprocess.Popen(
        [sys.executable, "-c", _BARE, str(recordings // cores), str(archive), str(out / str(core)),
         str(start_at)], stdout=subprocess.PIPE, text=True, cwd=Path(__file__).parents[1])
        for core in range(cores)]
    rates = []
    for one in running:
        frames, taken_s = one.communicate()[0].split()
        rates.append(int(frames) / float(taken_s))
    shutil.rmtree(out)
    return sum(rates)


def _speed(args: argparse.Namespace, top: Path) -> None:
    scratch = top / "scratch"
    scratch.mkdir(mode=0o700)
    begun_s = time.perf_counter()
    dask = local_engine(run_task, args.workers, scratch)
    _run(dask, args.archive, top / "warm", args.workers)
    dask_s = time.perf_counter() - begun_s
    pool = PoolEngine(run_task, args.workers)
    engines = {"Dask, a local cluster by TLS": _Watched(dask),
               "a pool of processes": _Watched(pool)}
    busy: dict[str, list[float]] = {name: [] for name in engines}
    recordings = -(-args.frames // (_FRAMES_EACH * args.rounds))
    rates: dict[str, list[float]] = {name: [] for name in engines}
    rates["the bare function, on each core"] = []
    try:
        for engine in engines.values():
            _run(engine, args.archive, top / "warm", _WARM)
        frames = 0
        for _ in range(args.rounds):
            for name, engine in engines.items():
                engine.worked_s = 0.0
                done, taken_s = _run(engine, args.archive, top / "out", recordings)
                busy[name].append(engine.worked_s / taken_s / args.workers)
                rates[name].append(done / taken_s)
            frames += done
            rates["the bare function, on each core"].append(
                _bare_on_all_cores(args.workers, args.archive, top / "bare", recordings))
    finally:
        dask.close()
        pool.close()
    ours = median(rates["Dask, a local cluster by TLS"])
    print(f"\n{frames:,} frames with each, {args.workers} workers, {args.rounds} rounds by turns; "
          f"until the cluster's first face {dask_s:.1f} s, which is not counted:\n")
    print("| | frames a second, median | Dask's share of it | of their time workers worked |\n"
          "| --- | --- | --- | --- |")
    for name, found in rates.items():
        worked = f"{median(busy[name]):.3f}" if name in busy else "1"
        print(f"| {name} | {median(found):.2f} | {ours / median(found):.2f} | {worked} |")
    print("\nGoal: 0.85 of both.")


def _nothing(plain: dict[str, object]) -> dict[str, object]:
    """Answer as a worker that finds faces in no time."""
    task = Task.of_plain(plain)
    rows = [Row(source=part.source, frame=0, state="face", output=f"faces/{part.name}.ply",
                thumbnail=b"\xff\xd8\xff" + bytes(2000)).as_dict() for part in task.parts]
    time.sleep(0.01)
    return {"rows": rows, "kept": [], "left": [], "again": [], "stop": "", "passing": False,
            "full": False, "looked": len(rows), "seconds": 0.35}


def _memory(args: argparse.Namespace, top: Path) -> None:
    """Watch the client, in whose process the scheduler is, over many frames that cost nothing."""
    from denseface.service.tools.batch.summary.writer import SummaryWriter

    scratch = top / "scratch"
    scratch.mkdir(mode=0o700)
    engine = local_engine(_nothing, args.workers, scratch, preload="tests.unit.service.tools.batch."
                          "tasks")
    own, marks = psutil.Process(), []
    wanted = [200, 2_000, args.fake // 4, args.fake // 2, args.fake]
    done = 0
    try:
        with SummaryWriter(top / "rows") as summary:

            def gather(rows: list[Row], _: list[Row]) -> None:
                nonlocal done
                summary.add(*rows)
                done += len(rows)
                while wanted and done >= wanted[0]:
                    marks.append((wanted.pop(0), own.memory_info().rss / 2**20))

            sources = (Part(f"/in/{at:08}.npz", f"{at:08}", many=False) for at in range(args.fake))
            Schedule(engine, Task(str(top), _plan(), [], 0, 0.0, 120.0), sources, Losses(top),
                     gather).run()
    finally:
        engine.close()
    print("\nResident set of the client, scheduler and summary (one process), with frames that "
          "cost nothing and pictures of 2 kB:\n\n| frames | MiB |\n| --- | --- |")
    for frames, mb in marks:
        print(f"| {frames:,} | {mb:.0f} |")


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="script/bench batch", description=__doc__)
    parser.add_argument("--frames", type=int, default=2000, help="of each way (2000)")
    parser.add_argument("--rounds", type=int, default=4, help="by turns (4)")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)))
    parser.add_argument("--fake", type=int, default=20_000, metavar="N",
                        help="frames of the memory's table (20000); 0 for none")
    parser.add_argument("--archive", type=Path, default=RECORDINGS, metavar="DIR",
                        help="recordings (those that come along)")
    args = parser.parse_args()
    for name in ("frames", "rounds", "workers"):
        if getattr(args, name) < 1:
            parser.error(f"--{name} must be at least 1, got {getattr(args, name)}")
    print(describe("script/bench batch " + " ".join(sys.argv[1:])))
    parts: list[Callable[[argparse.Namespace, Path], None]] = [_speed]
    if args.fake:
        parts.append(_memory)
    for part in parts:
        with tempfile.TemporaryDirectory(prefix="denseface-batch-", dir=Path.cwd()) as top:
            part(args, Path(top))
    return 0


if __name__ == "__main__":
    sys.exit(main())
