"""The colour camera's exposure: waited for after the start, locked while one capture is taken.

Exposure and white balance of these sensors settle within about 30 frames; the first are dark and
of another hue. The frames of a burst are to be of one brightness.
"""

import ctypes
from collections import deque
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.capture.openni2._binding import OpenNIError

_AUTO_WHITE_BALANCE, _AUTO_EXPOSURE = 100, 101
"""OpenNI2's numbers of stream properties."""
_FRAMES = 30
"""After that many the camera counts as settled, however its brightness changes: people move."""
_SAME = 5
"""Frames in a row that are alike where the camera has settled."""
_ALIKE = 0.02, 0.5
"""How far the means of a channel may differ in those, by their mean, and grey levels."""
_STEP = 8
"""Every so many rows and columns are looked at."""


class Settling:
    """Tells from the images alone when a colour camera has settled."""

    def __init__(self) -> None:
        self._frames = 0
        self._means: deque[NDArray[np.float64]] = deque(maxlen=_SAME)

    def settled(self, color: NDArray[np.uint8]) -> bool:
        """Take the next image, (H, W, 3) uint8; say whether brightness and hue stay the same."""
        self._frames += 1
        self._means.append(color[::_STEP, ::_STEP].mean(axis=(0, 1), dtype=np.float64))
        if self._frames >= _FRAMES:
            return True
        if len(self._means) < _SAME:
            return False
        means = np.array(self._means)
        share, levels = _ALIKE
        return bool((np.ptp(means, axis=0) <= np.maximum(share * means.mean(axis=0), levels)).all())


class Exposure(Settling):
    """The exposure of an open colour stream, or of none; call `lock` and `unlock` while it runs.

    Parameters
    ----------
    color : the binding's colour stream; None where the sensor has none
    by_freenect : the driver is Freenect's, whose property of the exposure sets the white balance
    """

    def __init__(self, color: Any, *, by_freenect: bool = False) -> None:
        super().__init__()
        self._color = color
        names = {_AUTO_WHITE_BALANCE: "white balance"}
        if not by_freenect:
            names[_AUTO_EXPOSURE] = "exposure"
        self._known = {number: name for number, name in names.items()
                       if color is not None and _read(color, number) is not None}
        self._free: tuple[str, ...] = ()

    @property
    def missing(self) -> tuple[str, ...]:
        """What of exposure and white balance the driver cannot lock."""
        return tuple(name for name in ("exposure", "white balance")
                     if name not in self._known.values())

    @property
    def doubt(self) -> str:
        """What was not locked by the last `lock`, as a note of a frame; empty without doubt."""
        free = self.missing + self._free
        if self._color is None or not free:
            return ""
        return f"the {' and '.join(free)} of the color camera could not be locked"

    def settled(self, color: NDArray[np.uint8] | None) -> bool:
        """Take the next image, (H, W, 3) uint8; say whether the camera has settled.

        That of a sensor without colour has.
        """
        return color is None or super().settled(color)

    def lock(self) -> None:
        """Keep exposure and white balance as they are, where the driver can; see `doubt`."""
        self._set(on=False)

    def unlock(self) -> None:
        """Let the camera find them by itself again: also a sensor that was left locked."""
        self._set(on=True)

    def _set(self, *, on: bool) -> None:
        free = []
        for number, name in self._known.items():
            with suppress(OpenNIError):
                self._color.set_property(number, ctypes.c_int(on))
            if _read(self._color, number) is not on:
                free.append(name)
        self._free = () if on else tuple(free)


def _read(stream: Any, number: int) -> bool | None:
    with suppress(OpenNIError):
        return bool(stream.get_property(number, ctypes.c_int).value)
    return None
