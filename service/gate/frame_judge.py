"""Judging one frame after the other, whatever their numbers are."""

from collections.abc import Callable

import structlog

from denseface.capture.frame import RgbdFrame
from denseface.recon.numerics.compilation.progress import compiling
from denseface.recon.pipeline import ends_the_same
from denseface.recon.quality import Quality, measure
from denseface.service.gate.hinting import Hinting, Judged

__all__ = ["FrameJudge"]

_log = structlog.get_logger("gate")


class FrameJudge:
    """Measures and judges the frames of one stream, by one thread at a time.

    Parameters
    ----------
    clock : for how long a hint is said, seconds
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._hinting = Hinting()
        self._quality: Quality | None = None
        self._last: tuple[RgbdFrame, Judged] | None = None

    def judge(self, frame: RgbdFrame, at_us: int | None = None) -> Judged:
        """Judge the next frame, or say again what was said of the last one.

        Parameters
        ----------
        frame : a frame that cannot be measured counts as one without a face
        at_us : when it was exposed, by any clock; by its stamp where None
        """
        if self._last is not None and self._last[0] is frame:
            return self._last[1]
        try:
            with compiling.session():  # the first frame may have to wait for kernels: that is said
                self._quality = measure(frame, self._quality, at_us)
        except Exception as error:
            if not ends_the_same(error):
                raise
            _log.warning("quality not measured", reason=f"{type(error).__name__}: {error}"[:200])
            self._quality = Quality(frame.depth_timestamp_us, somebody=True)
        judged = self._hinting.judge(self._quality, self._clock())
        self._last = frame, judged
        return judged
