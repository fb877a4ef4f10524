"""What is done to each frame of a source before it is given: put right, and turned upright."""

import time
from collections.abc import Callable

from denseface.capture.agreement import Agreement, Verdict, measure_agreement
from denseface.capture.errors import MismatchedFrameError
from denseface.capture.frame import RgbdFrame
from denseface.capture.rotation import ROTATIONS, rotate_frame

__all__ = ["FramePreparation"]

_EVERY_S = 60.0
"""Seconds between looks at whether depth and colour of a source belong together."""
_AGAIN_S = 1.0
"""The same while nothing fits."""
_TRIES = 5
"""Frames that are looked at in the beginning, until one tells something."""
_SURE = 2
"""Frames in a row that must say so before what was found is given up: one alone may show somebody
who moved between depth and colour."""


class FramePreparation:
    """Measures whether a source's depth and colour belong together, and puts its frames right.

    The first frames are measured until one tells something, and another every minute.

    Parameters
    ----------
    rotation : degrees by which frames are turned, clockwise: 0, 90, 180 or 270
    clock : gives seconds
    """

    def __init__(
        self, rotation: int = 0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        if rotation not in ROTATIONS:
            raise ValueError(f"rotation must be one of {ROTATIONS}, got {rotation}")
        self._rotation = rotation
        self._clock = clock
        self._found = Agreement(Verdict.UNKNOWN)
        """What holds for all frames."""
        self._last = self._found
        """What the last frame said that said anything, and how many in a row said the same."""
        self._times = 0
        self._silent = 0
        """Frames in a row that were measured and told nothing."""
        self._due = float("-inf")
        self._strict = False

    def look_closely(self, *, refuse: bool = False) -> None:
        """Measure the next frame, however short ago one was measured.

        refuse : raise where nothing fits; otherwise such a frame has a note. So has one of a source
            whose frames belonged together before, unless the next says the same
        """
        self._due = float("-inf")
        self._strict = refuse

    @property
    def agrees(self) -> bool:
        """Whether frames were measured and found to be what they say of themselves."""
        return self._found.verdict is Verdict.AGREES

    @property
    def _is_sure(self) -> bool:
        """Whether what the last frame said holds; not where it alone contradicts those before."""
        return self._found.verdict is Verdict.UNKNOWN or self._times >= _SURE

    def of(self, frame: RgbdFrame) -> RgbdFrame:
        """Give a frame as its user gets it.

        Parameters
        ----------
        frame : as the source's images and calibration make it

        Raises
        ------
        MismatchedFrameError
            There is enough to see, depth and colour belong together in no way that is known, and
            `look_closely` was told to refuse such a frame.
        """
        notes = []
        if self._clock() >= self._due:
            strict, self._strict = self._strict, False
            now = self._measure(frame)
            if now.verdict is Verdict.REFUSED and strict and self._is_sure:
                # What was odd before may be why.
                raise MismatchedFrameError("; ".join((now.note, *frame.origin.notes)))
            if now.verdict in (Verdict.DOUBTFUL, Verdict.REFUSED):
                notes.append(now.note)
        notes += [note for note in (self._found.lasting_note,) if note and note not in notes]
        frame = self._found.correction.apply(frame)
        return rotate_frame(frame.with_note(*notes) if notes else frame, self._rotation)

    def _measure(self, frame: RgbdFrame) -> Agreement:
        now = measure_agreement(frame)
        if now.verdict is Verdict.UNKNOWN:
            self._silent += 1
        else:
            self._silent = 0
            self._times = self._times + 1 if now.means_the_same(self._last) else 1
            self._last = now
            if now.verdict is not Verdict.REFUSED and self._is_sure:
                self._found = now
        if now.verdict is Verdict.REFUSED:
            self._due = self._clock() + _AGAIN_S
        elif self._silent >= _TRIES or self._times >= _SURE or (
                now.verdict is Verdict.AGREES and self._found is now):
            self._due = self._clock() + _EVERY_S
        return now
