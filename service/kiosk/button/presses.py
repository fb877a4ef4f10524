"""From what an input device writes to presses of a button."""

import struct

__all__ = ["DEBOUNCE_S", "EV_KEY", "RECORD", "Presses"]

RECORD = struct.Struct("@llHHi")
"""`struct input_event` of `linux/input.h` as this machine has it: seconds, microseconds, type,
code, value."""
EV_KEY = 0x01
"""Type of a record of a key or button, `linux/input-event-codes.h`."""
_PRESSED = 1
"""Its value when it goes down; 0 when it comes up, 2 while it is held."""
DEBOUNCE_S = 0.1
"""A contact that bounces goes down again within so long, seconds; nobody presses twice as fast."""


class Presses:
    """Eats bytes, which may end in the middle of a record. Any key of the device is the button."""

    def __init__(self) -> None:
        self._rest = b""
        self._last_s: float | None = None

    def feed(self, data: bytes, now_s: float) -> int:
        """Take what was read and give how often the button was pressed.

        Parameters
        ----------
        now_s : any clock that only goes forward, seconds; the records' own may be set back
        """
        data = self._rest + data
        whole = len(data) - len(data) % RECORD.size
        self._rest = data[whole:]
        presses = 0
        for *_, kind, _, value in RECORD.iter_unpack(data[:whole]):
            if kind != EV_KEY or value != _PRESSED:
                continue
            if self._last_s is None or now_s - self._last_s >= DEBOUNCE_S:
                presses += 1
            self._last_s = now_s
        return presses
