"""Faults of a live sensor at random, one to three at a time, and how soon a press is answered.

Each fault is over when the press comes: the time is what the service takes to come back.
"""

import random
import time
from collections.abc import Callable
from dataclasses import dataclass

from bench.capture_service import Resources, capture_process, press_until_taken
from bench.service_processes import running
from tests.virtual_sensor.control import Call, Control, DeviceState, OpenFault, Stamps
from tests.virtual_sensor.process import environment

__all__ = ["Recovery", "recoveries"]

_PAUSES_S = (0.0, 0.02, 0.3, 1.0, 3.0)
"""How long a fault that lasts does so."""
_JUMPS_US = (-2_000_000, -500_000, 300_000, 5_000_000)


@dataclass(frozen=True)
class Recovery:
    """What happened in one round."""

    faults: tuple[str, ...]
    seconds: float
    """From the end of the last fault to the answer of a press."""


class _Faults:
    """What can go wrong with a sensor."""

    def __init__(self, sensor: Control, seed: int) -> None:
        self._sensor = sensor
        self._random = random.Random(seed)  # noqa: S311
        self._address = 0

    def some(self) -> tuple[str, ...]:
        """Let one to three things go wrong, one after the other, and name them."""
        all_of_them: tuple[Callable[[], None], ...] = (
            self.unplugged, self.silent, self.frozen, self.lost, self.wrong_size, self.garbled,
            self.jump, self.stamps, self.state, self.refused, self.hangs)
        chosen = self._random.choices(all_of_them, k=self._random.randint(1, 3))
        for fault in chosen:
            fault()
        return tuple(fault.__name__ for fault in chosen)

    def _pause(self) -> None:
        time.sleep(self._random.choice(_PAUSES_S))

    def _both(self, **fields: object) -> None:
        self._sensor.depth.update(fields)
        self._sensor.color.update(fields)

    def _one(self, **fields: object) -> None:
        self._random.choice((self._sensor.depth, self._sensor.color)).update(fields)

    def unplugged(self) -> None:
        self._sensor.unplug()
        self._pause()
        self._address += self._random.randint(0, 1)
        self._sensor.replug(f"virtual:{self._address}")

    def silent(self) -> None:
        self._one(silent=True)
        self._pause()
        self._both(silent=False)

    def frozen(self) -> None:
        self._both(frozen=True, frozen_stamps=self._random.random() < 0.5)
        self._pause()
        self._both(frozen=False, frozen_stamps=False)

    def lost(self) -> None:
        self._one(drop_next=self._random.choice((1, 5, 30)))

    def wrong_size(self) -> None:
        self._one(wrong_size_next=self._random.choice((1, 5, 30)))

    def garbled(self) -> None:
        self._one(garbled_next=self._random.choice((1, 5)))

    def jump(self) -> None:
        self._one(stamp_offset_us=self._random.choice(_JUMPS_US))

    def stamps(self) -> None:
        self._one(stamps=self._random.choice(list(Stamps)))

    def state(self) -> None:
        self._sensor.state = DeviceState.ERROR
        self._pause()
        self._sensor.state = DeviceState.OK

    def refused(self) -> None:
        self._sensor.open_fault = self._random.choice((OpenFault.BUSY, OpenFault.NO_PERMISSION))
        self.unplugged()
        self._pause()
        self._sensor.open_fault = OpenFault.NONE

    def hangs(self) -> None:
        self._sensor.hang = self._random.choice(list(Call))
        self.unplugged()
        self._pause()
        self._sensor.hang = Call.NONE


def recoveries(
    sensor: Control, rounds: int, seed: int = 0
) -> tuple[list[Recovery], Resources, int]:
    """Let things go wrong again and again, under `up`, and press after each round.

    Returns
    -------
    each round; what the capture process holds at the end; how many there were of it
    """
    faults, found = _Faults(sensor, seed), []
    with running("openni2:", 1, environment(controls=[sensor])) as service:
        press_until_taken(service)
        for _ in range(rounds):
            names = faults.some()
            start = time.monotonic()
            press_until_taken(service)
            found.append(Recovery(names, time.monotonic() - start))
        return found, Resources.of(capture_process(service)), sensor.loads
