"""Whether a press gets a frame: at once, when it is good enough, or not at all."""

from dataclasses import dataclass
from enum import Enum

from denseface.service.gate.hinting import Judged
from denseface.service.protocol.sensor_messages import Gate

__all__ = ["Decision", "GatedPress"]


class Decision(Enum):
    """What becomes of a press with a frame that was judged."""

    TAKE = "take"
    """The press gets this frame."""
    WAIT = "wait"
    """Judge the next frame."""
    REFUSE = "refuse"
    """The press is refused, with the hint of this frame."""


@dataclass(frozen=True)
class GatedPress:
    """A press that wants a good frame.

    Attributes
    ----------
    gate : `off`, `wait` or `refuse`
    settled_by_s : by the clock of `decide`. Until then the gate may just have begun to look: it
        takes some frames to tell motion, and to find a face that is hard to see
    deadline_s : when `wait` gives up
    """

    gate: Gate
    settled_by_s: float
    deadline_s: float

    def decide(self, judged: Judged, now_s: float) -> Decision:
        """Decide on a frame that was exposed after the press; see `Decision`."""
        settled = now_s >= self.settled_by_s
        if self.gate == "off" or (judged.ready and (settled or judged.motion_known)):
            return Decision.TAKE
        if not settled or (self.gate == "wait" and now_s < self.deadline_s):
            return Decision.WAIT
        return Decision.REFUSE
