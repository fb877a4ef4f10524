"""The service with the virtual sensor: what the capture process takes, and how it comes back."""

import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import psutil

from bench.service_processes import Running, kind_of, running
from denseface.service.errors import PressRefusedError
from tests.virtual_sensor.control import Control
from tests.virtual_sensor.marks import read_mark
from tests.virtual_sensor.process import environment

__all__ = ["Resources", "capture_process", "idle_and_previews", "press_until_taken", "replugs",
           "steady"]

_MIB = 2**20
_DRIVER_THREAD = "virtual-sensor"
"""Name of the virtual sensor's own threads."""
_UNPLUGGED_S = 0.3
"""How long the plug is out, seconds."""
_SAMPLES = 5
"""Rows of a table of resources."""
_AGAIN_S = 0.02
"""Pause after a press that was refused, seconds."""
_COME_BACK_S = 60.0
"""Longest wait for a press with a frame, seconds."""


@dataclass(frozen=True)
class Resources:
    """What a process holds."""

    pid: int
    memory_mib: float
    descriptors: int
    threads: int

    @classmethod
    def of(cls, process: psutil.Process) -> "Resources":
        """Look."""
        return cls(process.pid, process.memory_full_info().uss / _MIB, process.num_fds(),
                   process.num_threads())


def capture_process(service: Running) -> psutil.Process:
    """Give the process that has the sensor; another one while the supervisor replaces it."""
    until = time.monotonic() + _COME_BACK_S
    while time.monotonic() < until:
        with suppress(psutil.NoSuchProcess, StopIteration):
            return next(one for one in service.family() if kind_of(one) == "capture")
        time.sleep(0.1)
    raise RuntimeError("there is no capture process")


def idle_and_previews(sensor: Control, seconds: float) -> tuple[float, float, float, float]:
    """Give % of a core while idle, and with a subscriber to previews; their rate and age (ms)."""
    sensor.marks = True
    with running("openni2:", 1, environment(controls=[sensor])) as service:
        sensor.wait_frames(60)
        process = capture_process(service)
        idle = _load(process, seconds)
        ages_ms: list[float] = []
        stop = threading.Event()
        watcher = threading.Thread(target=_watch, args=(service, stop, ages_ms))
        watcher.start()
        sensor.wait_frames(30)
        ages_ms.clear()
        busy = _load(process, seconds)
        count = len(ages_ms)
        stop.set()
        watcher.join()
    ages_ms.sort()
    return idle, busy, count / seconds, ages_ms[int(0.95 * len(ages_ms))]


def _watch(service: Running, stop: threading.Event, ages_ms: list[float]) -> None:
    """Take previews; the mark in each says how old it is."""
    for preview in service.client.previews(timeout=_COME_BACK_S):
        now_ns = time.monotonic_ns()
        ages_ms.append((now_ns - read_mark(preview.image).exposed_ns) / 1e6)
        if stop.is_set():
            return


def _load(process: psutil.Process, seconds: float) -> float:
    before, start = _used_s(process), time.monotonic()
    time.sleep(seconds)
    return 100 * (_used_s(process) - before) / (time.monotonic() - start)


def _used_s(process: psutil.Process) -> float:
    """Give the processor time so far of all threads but the virtual sensor's."""
    used = sum(process.cpu_times()[:2])
    for thread in process.threads():
        name = Path(f"/proc/{process.pid}/task/{thread.id}/comm")
        with suppress(OSError):
            if name.read_text().strip() == _DRIVER_THREAD:
                used -= thread.user_time + thread.system_time
    return used


def steady(sensor: Control, frames: int) -> Iterator[tuple[int, Resources]]:
    """Let so many frames go by; give what the process holds every now and then."""
    with running("openni2:", 1, environment(controls=[sensor])) as service:
        first = sensor.depth.frames
        for part in range(1, _SAMPLES + 1):
            wanted = first + frames * part // _SAMPLES
            while sensor.depth.frames < wanted:
                time.sleep(0.05)
            yield sensor.depth.frames - first, Resources.of(capture_process(service))


def replugs(
    sensor: Control, cycles: int
) -> tuple[list[float], list[float], list[tuple[int, Resources]]]:
    """Unplug and plug in again, and press until there is a frame.

    Returns
    -------
    for each cycle the seconds from the plug to that press's answer, and to the sensor's first frame
    (also where the first press came before it); what the capture process holds every now and then
    """
    answered, streamed, taken = [], [], []
    with running("openni2:", 1, environment(controls=[sensor])) as service:
        press_until_taken(service)
        for cycle in range(1, cycles + 1):
            sensor.unplug()
            time.sleep(_UNPLUGGED_S)
            sent = sensor.depth.frames
            sensor.replug(f"virtual:{cycle}")
            start = time.monotonic()
            watch = threading.Thread(target=_wait_frames, args=(sensor, sent, streamed, start))
            watch.start()
            press_until_taken(service)
            answered.append(time.monotonic() - start)
            watch.join()
            if cycle % max(1, cycles // _SAMPLES) == 0:
                taken.append((cycle, Resources.of(capture_process(service))))
    return answered, streamed, taken


def _wait_frames(sensor: Control, sent: int, streamed: list[float], start: float) -> None:
    while sensor.depth.frames <= sent and time.monotonic() < start + _COME_BACK_S:
        time.sleep(0.005)
    streamed.append(time.monotonic() - start)


def press_until_taken(service: Running) -> None:
    """Press until a frame is taken."""
    until = time.monotonic() + _COME_BACK_S
    while True:
        try:
            service.client.press()
        except PressRefusedError:
            if time.monotonic() > until:
                raise
            time.sleep(_AGAIN_S)
        else:
            return
