"""What the service does with many captures kept: start, dead letters, rebuild, purge.

Each is measured beside a bare loop over as many files of the same kind, in the same run.
"""

import argparse
import json
import os
import sqlite3
import statistics
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import zmq

from bench.growth_captures import fill
from bench.machine import describe
from denseface.service.client import Operator
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage
from denseface.service.protocol.payload import FrameHeader
from denseface.service.protocol.wire import Packet, decode_from_hub, encode
from tests.unit.service.faces import small_frame

__all__: list[str] = []

_LIMIT_S = 600.0
_BATCH = 250
"""Captures in one transaction of the bare purge, as in one of the hub's."""
_HEAD_BYTES = 2**14
_BODY = len(b"denseface spool 3\n") + 32
"""Where a file's index begins."""
_LATE_MS = 50.0
_REPEAT_MS = 20


class _Peer:
    """A connection to a hub on this machine."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", address: str) -> None:
        self.socket = context.socket(zmq.DEALER)
        self.socket.linger = 0
        self.socket.set(zmq.RECONNECT_IVL, 1)
        self.socket.set(zmq.RECONNECT_IVL_MAX, 2)
        self.socket.connect(address)
        self._request = 0

    def send(self, message: BaseMessage) -> None:
        """Say something."""
        self.socket.send_multipart(encode(Packet(message)))

    def hear(self) -> BaseMessage:
        """Wait for a message."""
        if not self.socket.poll(_LIMIT_S * 1000):
            raise TimeoutError("the hub says nothing")
        return decode_from_hub(self.socket.recv_multipart()).message

    def status(self) -> tuple[float, messages.Status]:
        """Ask for the status; with the round trip, ms."""
        self._request += 1
        start = time.perf_counter()
        self.send(messages.GetStatus(request=self._request))
        while True:
            answer = self.hear()
            if isinstance(answer, messages.Status) and answer.request == self._request:
                return (time.perf_counter() - start) * 1e3, answer

    def dead_letters(self) -> tuple[list[float], int]:
        """List all dead letters; round trips, ms, and their number."""
        taken, after, count = [], 0, 0
        while True:
            self._request += 1
            start = time.perf_counter()
            self.send(messages.ListDead(request=self._request, after=after))
            answer = self.hear()
            taken.append((time.perf_counter() - start) * 1e3)
            if not isinstance(answer, messages.DeadLetters):
                raise TypeError(f"dead letters were expected, found {answer.kind}")
            if not answer.letters:
                return taken, count
            after, count = answer.letters[-1].sequence, count + len(answer.letters)


@dataclass
class _Trips:
    """Round trips of `get_status`, one each few milliseconds."""

    ms: list[float] = field(default_factory=list)
    states: list[str] = field(default_factory=list)

    def add(self, peer: _Peer) -> messages.Status:
        """Make one."""
        taken, status = peer.status()
        self.ms.append(taken)
        self.states.append(status.state)
        time.sleep(0.005)
        return status

    def row(self) -> str:
        """Give number, median, worst, and how many were late."""
        late = sum(one > _LATE_MS for one in self.ms)
        return (f"{len(self.ms):,} | {statistics.median(self.ms):.1f} | {max(self.ms):.1f} "
                f"| {late} |")


@contextmanager
def _hub(address: str, data: Path) -> Iterator[float]:
    """Run a hub, and give when it was started."""
    with (data.parent / "hub.log").open("ab") as log:
        started = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "denseface", "hub", "--address", address, "--data",
             str(data), "--retention", "off"], stderr=log,
            env=os.environ | {"DENSEFACE_RESERVE_MIB": "0"})
    try:
        yield started
    finally:
        process.terminate()
        if process.wait(_LIMIT_S):
            raise RuntimeError((data.parent / "hub.log").read_text()[-2000:])


def _first_press(context: "zmq.Context[zmq.Socket[bytes]]", address: str, data: Path) -> float:
    """Start a hub and press until one is accepted; seconds from the start."""
    header, arrays = FrameHeader.of(small_frame())
    with _hub(address, data) as started:
        sensor, presser = _Peer(context, address), _Peer(context, address)
        with closing(sensor.socket), closing(presser.socket):
            sensor.send(messages.SensorReady(name="s", source="x"))
            press = messages.Press(request=1, capture_id=f"p{time.time_ns()}")
            presser.send(press)
            while not sensor.socket.poll(_REPEAT_MS):  # as clients do
                presser.send(press)
            take = sensor.hear()
            if not isinstance(take, messages.Take):
                raise TypeError(f"a take was expected, found {take.kind}")
            sensor.socket.send_multipart(encode(Packet(
                messages.Frame(capture_id=take.capture_id, frame=header), arrays)))
            answer = presser.hear()
            if not isinstance(answer, messages.PressAccepted):
                raise TypeError(f"the press was to be accepted, found {answer.kind}")
            return time.perf_counter() - started


def _bare_heads(data: Path) -> float:
    """Read and parse the head of each file; captures a second."""
    start = time.perf_counter()
    for folder in ("frames", "faces"):
        with os.scandir(data / folder) as entries:
            for entry in entries:
                descriptor = os.open(entry.path, os.O_RDONLY)
                head = os.pread(descriptor, _HEAD_BYTES, 0)
                os.close(descriptor)
                (count,) = struct.unpack_from("<I", head, _BODY)
                sizes = struct.unpack_from(f"<{count}Q", head, _BODY + 4)
                first = _BODY + 4 + 8 * count
                json.loads(head[first:first + sizes[0]])
                json.loads(head[first + sizes[0]:first + sizes[0] + sizes[1]])
    return len(os.listdir(data / "frames")) / (time.perf_counter() - start)  # noqa: PTH208


def _bare_purge(data: Path) -> float:
    """Remove files, sync folders, delete rows, empty the log, in batches; captures a second."""
    with closing(sqlite3.connect(data / "captures.sqlite3", isolation_level=None)) as database:
        database.executescript("PRAGMA synchronous=FULL; PRAGMA secure_delete=ON")
        names = list(database.execute("SELECT capture_id, settings_hash FROM captures"))
        start = time.perf_counter()
        for at in range(0, len(names), _BATCH):
            batch = names[at:at + _BATCH]
            for capture_id, settings in batch:
                for path in (f"frames/{capture_id}.frame", f"faces/{capture_id}.{settings}.face"):
                    (data / path).unlink(missing_ok=True)
            for folder in ("frames", "faces"):
                descriptor = os.open(data / folder, os.O_RDONLY)
                os.fsync(descriptor)
                os.close(descriptor)
            ids = [(capture_id,) for capture_id, _ in batch]
            database.execute("BEGIN IMMEDIATE")
            database.executemany("DELETE FROM outcomes WHERE capture_id = ?", ids)
            database.executemany("DELETE FROM captures WHERE capture_id = ?", ids)
            database.execute("COMMIT")
            database.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchone()
        return len(names) / (time.perf_counter() - start)


def _rebuild(
    context: "zmq.Context[zmq.Socket[bytes]]", address: str, data: Path, count: int
) -> tuple[float, _Trips]:
    """Lose the database and start; captures a second until served, and the statuses meanwhile."""
    for path in data.glob("captures.sqlite3*"):
        path.unlink()
    trips = _Trips()
    with _hub(address, data), closing((peer := _Peer(context, address)).socket):
        taken, status = peer.status()
        start = time.perf_counter() - taken / 1e3
        while status.state != "serving":
            status = trips.add(peer)
        seconds = time.perf_counter() - start
        if status.queued + status.done < count:
            raise RuntimeError(f"{count} captures were kept, found {status}")
    return count / seconds, trips


def _purge(address: str, peer: _Peer) -> tuple[float, _Trips]:
    """Purge all; captures a second, and the statuses meanwhile."""
    removed: list[int] = []

    def purge() -> None:
        with Operator(address) as operator:
            removed.append(operator.purge(everything=True, timeout=_LIMIT_S))

    trips = _Trips()
    start = time.perf_counter()
    thread = threading.Thread(target=purge)
    thread.start()
    while thread.is_alive():
        trips.add(peer)
    return removed[0] / (time.perf_counter() - start), trips


def _main() -> None:
    parser = argparse.ArgumentParser(prog="script/bench growth_service", description=__doc__)
    parser.add_argument("--captures", type=int, default=50_000)
    parser.add_argument("--starts", type=int, default=5, help="of which the median is taken")
    count = (args := parser.parse_args()).captures
    print(describe(f"script/bench growth_service --captures {count}"))
    with tempfile.TemporaryDirectory(prefix="df-") as folder, zmq.Context() as context:
        data, other, empty = (Path(folder) / name for name in ("data", "other", "empty"))
        address = f"ipc://{folder}/hub"
        fill(data, count)
        fill(other, min(count, 10_000))
        starts = {name: statistics.median(
            _first_press(context, address, one) for _ in range(args.starts))
            for name, one in (("much", data), ("nothing", empty))}
        with _hub(address, data), closing((peer := _Peer(context, address)).socket):
            while peer.status()[1].state != "serving":
                time.sleep(0.01)
            pages, dead = peer.dead_letters()
            idle = _Trips()
            for _ in range(1000):
                idle.add(peer)
        heads = _bare_heads(data)
        rebuilt, during_rebuild = _rebuild(context, address, data, count)
        with _hub(address, data), closing((peer := _Peer(context, address)).socket):
            while peer.status()[1].state != "serving":
                time.sleep(0.01)
            purged, during_purge = _purge(address, peer)
        left = sum(len(list((data / one).iterdir())) for one in ("frames", "faces"))
        bare = _bare_purge(other)
    print(f"\n{count:,} captures kept, of small frames; files left after the purge: {left}.\n")
    print("| | the service | bare | ratio |\n| --- | ---: | ---: | ---: |")
    print("| from the start of the process to the first accepted press, s; bare: with nothing kept "
          f"| {starts['much']:.2f} | {starts['nothing']:.2f} "
          f"| {starts['much'] / starts['nothing']:.2f} |")
    page, trip = statistics.median(pages), statistics.median(idle.ms)
    print(f"| a page of `list_dead` ({dead:,} dead letters), ms; bare: `get_status` "
          f"| {page:.1f} | {trip:.1f} | {page / trip:.2f} |")
    print("| database made again, captures / s; bare: the heads of the files read and parsed "
          f"| {rebuilt:,.0f} | {heads:,.0f} | {rebuilt / heads:.2f} |")
    print("| purge of all, captures / s; bare: unlink, sync, delete, empty the log, by 250 "
          f"| {purged:,.0f} | {bare:,.0f} | {purged / bare:.2f} |")
    print("\nRound trips of `get_status` meanwhile, one each 5 ms: none can be answered while a "
          "tick is late.\n")
    print(f"| | round trips | median, ms | worst, ms | above {_LATE_MS:.0f} ms |\n"
          "| --- | ---: | ---: | ---: | ---: |")
    for name, trips in (("idle", idle), ("rebuild", during_rebuild), ("purge", during_purge)):
        print(f"| {name} | {trips.row()}")


if __name__ == "__main__":
    _main()
