"""How a visitor is led to where a picture is worth it: one hint at a time, a ring that fills."""

from denseface.service.gate.faults import Fault
from denseface.service.kiosk.page_messages import Arrow, PositionScreen
from denseface.service.kiosk.visit.options import VisitOptions
from denseface.service.protocol.hint import Hint

__all__ = ["ARROWS", "SHOWN_S", "Guidance"]

SHOWN_S = 0.8
"""A hint is shown for at least so long, seconds: the time to read three words."""

ARROWS = {
    Fault.MOVE_BACK: Arrow.BACK, Fault.COME_CLOSER: Arrow.CLOSER, Fault.MOVE_LEFT: Arrow.LEFT,
    Fault.MOVE_RIGHT: Arrow.RIGHT, Fault.MOVE_UP: Arrow.UP, Fault.MOVE_DOWN: Arrow.DOWN,
}
"""The gate's left is the person's own, and in a mirror that is the picture's left."""


class Guidance:
    """Eats the hints of one search for a good picture.

    Parameters
    ----------
    now_s : when the search begins; the same clock as all that follow
    """

    def __init__(self, options: VisitOptions, now_s: float) -> None:
        self._options = options
        self._slow_from_s = now_s + options.slow_s
        self._shown: str | None = None
        self._shown_since_s = now_s
        self.codes: tuple[str, ...] = ()
        """What is wrong with the last sample, the most important first."""
        self._sampled = False
        self._good_since_s: float | None = None
        self._good_s = 0.0
        """Between the first and the last of the good samples."""
        self._faced_s = now_s

    def hint(self, hint: Hint, now_s: float) -> None:
        """Take the next sample."""
        self._sampled = True
        if has_face(hint):
            self._faced_s = now_s
        self.codes = hint.codes
        if self.codes:
            self._good_since_s, self._good_s = None, 0.0
        elif self._good_since_s is None:
            self._good_since_s = now_s
        else:
            self._good_s = now_s - self._good_since_s
        first = self.codes[0] if self.codes else None
        if first != self._shown and (
                self._shown is None or now_s - self._shown_since_s >= SHOWN_S):
            self._shown, self._shown_since_s = first, now_s

    def forget(self) -> None:
        """Let what was seen count no more: there are no pictures now, or a countdown ended."""
        self._shown = self._good_since_s = None
        self.codes = ()
        self._sampled, self._good_s = False, 0.0

    def begin_again(self, now_s: float) -> None:
        """Forget, and let the time begin anew after which any picture will do."""
        self.forget()
        self._slow_from_s = now_s + self._options.slow_s

    @property
    def slow_from_s(self) -> float:
        """From then on the best there is will do."""
        return self._slow_from_s

    @property
    def settled(self) -> bool:
        """Two samples that are apart were good, and all between them."""
        return self._good_since_s is not None and self._good_s >= self._options.sample_gap_s

    def lost(self, now_s: float) -> bool:
        """Whether no face was seen for long."""
        return now_s - self._faced_s >= self._options.lost_s

    @property
    def nobody(self) -> bool:
        """Whether the last sample shows nobody at all."""
        return self.codes[:1] == (Fault.NOBODY,)

    def warns(self, now_s: float) -> bool:
        """Whether a press would take the best there is, with its warnings."""
        return (now_s >= self._slow_from_s and self._good_since_s is None
                and self._sampled and not self.nobody)

    def can_press(self, now_s: float) -> bool:
        """Whether a press takes a picture."""
        return self._good_since_s is not None or self.warns(now_s)

    def screen(self, now_s: float) -> PositionScreen:
        """Say what is shown."""
        arrow = ARROWS.get(Fault(self._shown)) if self._shown in set(Fault) else None
        progress = 0.0
        if self._good_since_s is not None:
            progress = min((1 + self._good_s / self._options.sample_gap_s) / 2, 1.0)
        return PositionScreen(
            hint=self._shown, arrow=arrow, progress=round(progress, 2),
            can_press=self.can_press(now_s), with_warnings=self.warns(now_s))


def has_face(hint: Hint) -> bool:
    """Whether a sample shows a face."""
    return "distance_mm" in hint.measures
