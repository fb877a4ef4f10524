"""Starting: what commands and a worker cost until they have done, or are ready, with warm kernels.

    script/bench startup [--rounds N]

Processor time of the whole process, user and system, and time that passed; by turns, so that what
else the machine does meets all alike. The peer is a process that imports numba, cv2 and the two
parts of scipy that a reconstruction may need, and does nothing.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import psutil

from bench import machine
from bench.service_processes import Running, running

_RECORDING = Path("fixtures/recorded_oni/frontal_700.oni")
_PEER = "import numba, cv2, scipy.linalg, scipy.spatial"
_BARER = "import numba, cv2, scipy"
"""scipy alone imports none of its parts."""
_ENVIRONMENT = {name: value for name, value in os.environ.items()
                if name != "PYTHONDONTWRITEBYTECODE"}  # an installation has its bytecode
_ENVIRONMENT["DENSEFACE_CORE_DUMPS"] = "1"  # else nobody may look at a process's times
_POLL_S = 0.01
_START_S = 60.0


@dataclass(frozen=True)
class Cost:
    """Of one process, seconds."""

    processor: float
    passed: float


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description="Measure what starting costs.")
    parser.add_argument("--rounds", type=int, default=9, help="of all, by turns (default: 9)")
    rounds = parser.parse_args().rounds
    head = machine.describe("script/bench startup")
    with tempfile.TemporaryDirectory() as folder, running(_RECORDING, 1) as service:
        face = f"{folder}/face.ply"
        runs: dict[str, Callable[[], Cost]] = {
            f"`{_PEER}`": partial(_run, "-c", _PEER),
            f"`{_BARER}`": partial(_run, "-c", _BARER),
            "`denseface reconstruct frontal_700.oni -o face.ply`":
                partial(_command, "reconstruct", str(_RECORDING), "-o", face),
            "`denseface press`": partial(_command, "press", "--address", service.address),
            "`denseface status`": partial(_command, "status", "--address", service.address),
            "`denseface list`": partial(_command, "list", "--address", service.address),
            "`denseface --help`": partial(_command, "--help"),
            "`denseface --version`": partial(_command, "--version"),
            "`denseface worker`, until it is ready": partial(_worker, service),
        }
        costs = _by_turns(runs, rounds)
    peer = costs[f"`{_PEER}`"]
    print(head)
    print("\n| | processor, s | x import | passed, s | x import |\n"
          "| --- | ---: | ---: | ---: | ---: |")
    for name, cost in costs.items():
        print(f"| {name} | {cost.processor:.2f} | {cost.processor / peer.processor:.2f} | "
              f"{cost.passed:.2f} | {cost.passed / peer.passed:.2f} |")


def _by_turns(runs: dict[str, Callable[[], Cost]], rounds: int) -> dict[str, Cost]:
    """Give the median of each, after a round that warms the disk's cache and the kernels'."""
    taken: dict[str, list[Cost]] = {name: [] for name in runs}
    for number in range(rounds + 1):
        for name, run in runs.items():
            cost = run()
            if number:
                taken[name].append(cost)
    return {name: Cost(statistics.median(one.processor for one in costs),
                       statistics.median(one.passed for one in costs))
            for name, costs in taken.items()}


def _command(*arguments: str) -> Cost:
    return _run("-m", "denseface", *arguments)


def _spawn(*arguments: str) -> int:
    return os.posix_spawn(
        sys.executable, [sys.executable, *arguments],
        _ENVIRONMENT,
        file_actions=[(os.POSIX_SPAWN_OPEN, fd, os.devnull, os.O_WRONLY, 0) for fd in (1, 2)])


def _run(*arguments: str) -> Cost:
    begun = time.perf_counter()
    _, status, used = os.wait4(_spawn(*arguments), 0)
    passed = time.perf_counter() - begun
    if status:
        raise RuntimeError(f"{' '.join(arguments)} ended with {status}")
    return Cost(used.ru_utime + used.ru_stime, passed)


def _worker(service: Running) -> Cost:
    """Start one more worker, and stop it when the hub has it for ready."""
    before = len(service.client.status().workers)
    begun = time.perf_counter()
    pid = _spawn("-m", "denseface", "worker", "--address", service.address)
    process = psutil.Process(pid)
    try:
        while len(service.client.status().workers) == before:
            if time.perf_counter() - begun > _START_S:
                raise RuntimeError("the worker did not become ready")
            time.sleep(_POLL_S)
        cost = Cost(sum(process.cpu_times()[:2]), time.perf_counter() - begun)
    finally:
        process.terminate()
        os.waitpid(pid, 0)
    while len(service.client.status().workers) > before:
        time.sleep(_POLL_S)
    return cost


if __name__ == "__main__":
    main()
