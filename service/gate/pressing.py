"""Whether a press gets a frame: at once, when it is good enough, the best of some, or none."""

from dataclasses import dataclass
from enum import Enum

from denseface.service.gate.hinting import Judged
from denseface.service.gate.scoring import Score, score_of, surely_good
from denseface.service.protocol.sensor_messages import Gate

__all__ = ["Decision", "GatedPress"]


_BETTER_WITHIN_S = 0.3
"""After the first frame with nothing wrong `best` looks for a better one for so long, seconds: ten
frames, in which a head that swings comes to rest. So its frame is never much older than that."""


class Decision(Enum):
    """What becomes of a press with a frame that was judged."""

    TAKE = "take"
    """The press gets this frame."""
    WAIT = "wait"
    """Judge the next frame."""
    KEEP = "keep"
    """The same, and keep this frame: it is the best so far."""
    TAKE_KEPT = "take kept"
    """The press gets the frame that was kept last."""
    REFUSE = "refuse"
    """The press is refused, with the hint of this frame."""


@dataclass
class GatedPress:
    """A press that wants a good frame.

    Attributes
    ----------
    gate : `off`, `wait`, `refuse` or `best`
    settled_by_s : by the clock of `decide`. Until then the gate may just have begun to look: it
        takes some frames to tell motion, and to find a face that is hard to see
    deadline_s : when `wait` gives up, and `best` takes what it has
    """

    gate: Gate
    settled_by_s: float
    deadline_s: float
    best: Score | None = None
    """Of the frame that was kept last."""

    def decide(self, judged: Judged, now_s: float) -> Decision:
        """Decide on a frame that was exposed after the press; see `Decision`."""
        settled = now_s >= self.settled_by_s
        if self.gate == "best":
            return self._decide_best(judged, now_s, settled=settled)
        if self.gate == "off" or (judged.ready and (settled or judged.motion_known)):
            return Decision.TAKE
        if not settled or (self.gate == "wait" and now_s < self.deadline_s):
            return Decision.WAIT
        return Decision.REFUSE

    def _decide_best(self, judged: Judged, now_s: float, *, settled: bool) -> Decision:
        """Take a frame that is surely good at once, the best one at the end, faults and all.

        The end is the deadline, or a moment after the first frame with nothing wrong.

        A frame without a face is taken where no other came, one without anybody never.
        """
        if surely_good(judged.quality):
            return Decision.TAKE
        score = score_of(judged.quality)
        better = score is not None and (self.best is None or score < self.best)
        if better:
            if score is not None and score.severity == 0:
                self.deadline_s = min(self.deadline_s, now_s + _BETTER_WITHIN_S)
            self.best = score
        with_face = self.best is not None and self.best.with_face
        if now_s < self.deadline_s or not (settled or with_face):
            return Decision.KEEP if better else Decision.WAIT
        if self.best is None:
            return Decision.REFUSE
        return Decision.TAKE if better else Decision.TAKE_KEPT
