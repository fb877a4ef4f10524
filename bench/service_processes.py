"""What the service's benchmark runs beside itself: the service, and the bare function in a loop."""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO

import psutil
import zmq

from denseface.service.client import Client
from denseface.service.protocol.topics import Topic
from denseface.service.transport.addresses import publications_of
from denseface.service.transport.sockets import open_socket

__all__ = ["Bare", "Running", "kind_of", "running"]

_START_S = 60.0
_CAPTURE_S = 60.0
"""Longest wait for one more outcome, seconds."""


@dataclass
class Running:
    """A running `denseface up`."""

    process: "subprocess.Popen[bytes]"
    address: str
    client: Client
    data: Path

    def family(self) -> list[psutil.Process]:
        """Give the supervisor and its processes, in the order of the process table."""
        up = psutil.Process(self.process.pid)
        return [up, *up.children()]

    def processor_s(self) -> dict[str, float]:
        """Give the processor time so far of each kind of process, and of this one, the client."""
        used = {"client": sum(psutil.Process().cpu_times()[:2])}
        for one in self.family():
            name = kind_of(one)
            used[name] = used.get(name, 0.0) + sum(one.cpu_times()[:2])
        return used

    def throughput(self, count: int) -> float:
        """Press so often, one press after the other; seconds from the first to the last face."""
        with zmq.Context() as context:
            # As they come, undecoded and not copied: what a subscriber does with a face is not
            # measured here, and on two cores it would take its time from the workers.
            socket = open_socket(context, zmq.SUB, publications_of(self.address))
            socket.set(zmq.LINGER, 0)
            socket.set(zmq.RCVHWM, 0)
            socket.connect(publications_of(self.address))
            socket.subscribe(Topic.STATUS.encode())
            socket.recv_multipart()  # the subscription is there
            socket.subscribe(Topic.FACES.encode())
            socket.unsubscribe(Topic.STATUS.encode())
            start = time.perf_counter()
            for _ in range(count):
                self.client.press()
            left = count
            while left:
                if not socket.poll(_CAPTURE_S * 1000):
                    raise RuntimeError(f"{left} of {count} faces did not come")
                left -= socket.recv_multipart(copy=False)[0].bytes == Topic.FACES.encode()
            took = time.perf_counter() - start
            socket.close()
        return took


def kind_of(process: psutil.Process) -> str:
    """Give the name in the process table of one of the service's processes."""
    command = process.cmdline()
    return command[4] if "-P" in command else "up"


@contextmanager
def running(
    source: Path | str, workers: int, env: Mapping[str, str] | None = None,
    flags: Sequence[str] = ("--no-kiosk",),
) -> Iterator[Running]:
    """Run the service with the settings of every day, in folders of its own.

    Parameters
    ----------
    env : its environment; by default this process's
    flags : more of `denseface up`
    """
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="df-")))
        address = f"ipc://{folder}/hub"
        with (folder / "log").open("wb") as log:
            process = subprocess.Popen(
                [sys.executable, "-m", "denseface", "up", "--source", str(source), "--address",
                 address, "--data", str(folder / "data"), "--workers", str(workers), *flags],
                stdin=subprocess.DEVNULL, stderr=log,
                # Else nobody may measure its memory.
                env={**(os.environ if env is None else env), "DENSEFACE_CORE_DUMPS": "1"})
        stack.callback(_stop, process)
        client = stack.enter_context(Client(address))
        until = time.monotonic() + _START_S
        while True:
            status = client.status(timeout=_START_S)
            if status.sensors and len(status.workers) == workers:
                break
            if time.monotonic() > until:
                raise RuntimeError(f"no sensor or workers: {(folder / 'log').read_text()[-2000:]}")
            time.sleep(0.1)
        yield Running(process, address, client, folder / "data")


def _stop(process: "subprocess.Popen[bytes]") -> None:
    process.terminate()
    process.wait(20)


class Bare:
    """Processes that call `reconstruct` in a loop, as a worker is set up, and nothing else."""

    def __init__(self, source: Path, count: int) -> None:
        self._processes = [subprocess.Popen(
            [sys.executable, "-m", "bench.bare", str(source)], stdin=subprocess.PIPE,
            stdout=subprocess.PIPE, text=True,
            env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"})
            for _ in range(count)]
        for process in self._processes:
            _line(process.stdout)  # warm

    def processor_s(self) -> float:
        """Give the processor time so far of all."""
        return sum(sum(psutil.Process(one.pid).cpu_times()[:2]) for one in self._processes)

    def throughput(self, count: int) -> float:
        """Reconstruct so many frames in all; seconds until the last process is through."""
        share, rest = divmod(count, len(self._processes))
        start = time.perf_counter()
        for number, process in enumerate(self._processes):
            if process.stdin is None:
                raise RuntimeError("no pipe")
            process.stdin.write(f"{share + (number < rest)}\n")
            process.stdin.flush()
        for process in self._processes:
            _line(process.stdout)
        return time.perf_counter() - start

    def close(self) -> None:
        """End them."""
        for process in self._processes:
            process.kill()
            process.communicate()


def _line(pipe: IO[str] | None) -> str:
    line = pipe.readline() if pipe else ""
    if not line:
        raise RuntimeError("bench.bare has ended")
    return line
