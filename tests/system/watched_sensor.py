"""A process that looks after the virtual sensor as the capture process does, and can be asked.

As a program it reads one name of a function below and its numbers a line, and answers with a line
of JSON. All times are `time.monotonic` of the machine, so that the test may compare them.
"""

import json
import os
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Self

from tests.nursery import Forked
from tests.waiting import LIMIT_S, until

_ROOT = Path(__file__).resolve().parents[2]


class Watched:
    """The process, from the test's side."""

    def __init__(self, env: dict[str, str], uri: str = "openni2:") -> None:
        self.process = Forked(
            ["-m", "tests.system.watched_sensor", uri], cwd=_ROOT,
            env=env | {"PYTHONPATH": str(_ROOT)}, stdin=subprocess.PIPE, stdout=subprocess.PIPE)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.process.close()

    def ask(self, *words: object) -> Any:
        assert self.process.stdin is not None
        assert self.process.stdout is not None
        timer = threading.Timer(LIMIT_S, self.process.kill)
        timer.start()
        try:
            print(*words, file=self.process.stdin, flush=True)
            answer = self.process.stdout.readline()
        finally:
            timer.cancel()
        assert answer, "the process ended"
        return json.loads(answer)

    def wait_state(self, *wanted: str) -> float:
        """Wait for one of some states and give when it was entered."""
        found = until(lambda: said if (said := self.ask("state"))[0] in wanted else None)
        return float(found[2])

    def press(self, number: int = 0) -> dict[str, Any]:
        """Take a frame: when it was asked for, what is known of it, its marks."""
        return dict(self.ask("press", number))

    def presses(self, count: int) -> list[dict[str, Any]]:
        """Press again and again, at any time within a frame's period."""
        return [self.press(number) for number in range(count)]

    def states_since(self, since_s: float) -> list[str]:
        """Give the states that were entered since."""
        return [state for state, _, at in self.ask("history") if at >= since_s]


def _serve(uri: str) -> None:
    import math

    from denseface.capture import identity
    from denseface.capture.live.pairs import LivePairs
    from denseface.capture.live.ring import Slot
    from denseface.capture.live.sensor import Shot, open_sensor
    from denseface.capture.live.states import LiveStates
    from denseface.capture.openni2 import _devices, _sensor
    from tests.virtual_sensor.marks import read_mark

    if fake := os.environ.get("FAKE_USB_DEVICES"):
        _devices.usb_devices = _sensor.usb_devices = lambda: identity.usb_devices(Path(fake))

    history: list[tuple[str, str, float]] = []
    """States, why and since when; by the thread that enters them: a look from outside could find
    the reason of one state with the next, and miss what lasts a moment."""
    explain, noting = LiveStates.explain, threading.Lock()

    def note(states: Any) -> None:
        with noting:
            now = states.state.value, states.reason
            if not history or history[-1][:2] != now:
                history.append((*now, time.monotonic()))

    def explained(states: LiveStates, reason: str) -> None:
        explain(states, reason)
        note(states)

    LiveStates.explain = explained  # type: ignore[method-assign]
    sensor = open_sensor(uri)
    assert sensor is not None
    told = threading.Event()

    def changed() -> None:
        told.set()
        note(sensor)

    def told_again() -> bool:
        """Ask for the newest pair, and again in between, and wait to be told of the next."""
        shot = sensor.latest()
        told.clear()
        again = sensor.latest()
        sensor.first_after(0.0)  # as somebody else would
        assert shot is not None
        assert again is not None
        return told.wait(LIMIT_S)

    arrived: dict[str, deque[int]] = {kind: deque(maxlen=8) for kind in ("depth", "color")}
    """Stamps of the last frames of each stream, microseconds."""
    add = LivePairs.add

    def noted(pairs: LivePairs, kind: str, slot: Slot, stamp_us: int, at_s: float) -> Any:
        arrived[kind].append(stamp_us)
        return add(pairs, kind, slot, stamp_us, at_s)

    LivePairs.add = noted  # type: ignore[method-assign]
    sensor.on_change = changed
    note(sensor)

    def taken(find: Callable[[], Shot | None]) -> Any:
        deadline = time.monotonic() + LIMIT_S
        asked_in = len(history) - 1
        while (shot := find()) is None:
            late = time.monotonic() > deadline
            for state, reason, _ in history[asked_in:]:
                if late or state not in ("opening", "warming", "streaming", "stalled"):
                    return {"refused": reason, "state": state}
            time.sleep(0.001)
        return shot

    def press(number: int = 0) -> Any:
        time.sleep(number * 0.0137 % 0.05)  # at any time within a period
        asked_s = time.monotonic()
        shot = taken(lambda: sensor.first_after(asked_s))
        got_s = time.monotonic()
        if isinstance(shot, dict):
            return shot | {"asked_s": asked_s, "got_s": got_s}
        frame, origin = shot.frame, shot.frame.origin
        marks = [read_mark(image, unit_um=frame.depth_meaning.unit_um)
                 for image in (frame.depth, frame.color) if image is not None]
        zero_s = marks[0].exposed_ns / 1e9 - frame.depth_timestamp_us / 1e6
        return {
            "arrived_s": {kind: [zero_s + us / 1e6 for us in [*stamps]]
                          for kind, stamps in arrived.items()},
            "asked_s": asked_s, "got_s": got_s, "number": shot.number,
            "exposed_s": [mark.exposed_ns / 1e9 for mark in marks],
            "earliest_s": shot.earliest_s, "latest_s": shot.latest_s, "skew_us": frame.skew_us,
            "exposure_known_by": origin.exposure_known_by, "captured_at": origin.captured_at,
            "skew_known_by": origin.skew_known_by, "notes": origin.notes, "sensor": origin.sensor,
            "brightness": 0 if frame.color is None else float(frame.color[20:].mean())}

    def burst(count: int) -> Any:
        after_s, numbers = time.monotonic(), []
        for _ in range(count):
            shot = taken(lambda after_s=after_s: sensor.first_after(after_s))
            numbers.append(shot.number)
            after_s = math.nextafter(shot.earliest_s, math.inf)
        return numbers

    def pause(seconds: int) -> None:
        """Let it wait for so long before what was opened in vain is opened again."""
        _sensor._RETRY_S = _sensor._MAX_RETRY_S = seconds

    calls: dict[str, Callable[..., Any]] = {
        "state": lambda: history[-1], "press": press, "burst": burst, "history": lambda: history,
        "told_again": told_again, "figures": lambda: asdict(sensor.figures),
        "identity": lambda: sensor.identity,
        "stuck": sensor.needs_new_process, "close": sensor.close,
        "cpu": time.process_time, "pause": pause,
    }
    for line in sys.stdin:
        name, *numbers = line.split()
        print(json.dumps(calls[name](*map(int, numbers))), flush=True)


if __name__ == "__main__":
    _serve(sys.argv[1])
