"""What can be wrong with a frame before it is taken, and what is said to the person."""

from enum import StrEnum

__all__ = ["Fault"]


class Fault(StrEnum):
    """One thing that is wrong; the most important first: only the first is said.

    Left and right are the person's own. Images are not mirrored (decision 0006): a person who looks
    at the camera has their left at the image's right.
    """

    NOBODY = "nobody"
    MOVE_BACK = "move_back"
    COME_CLOSER = "come_closer"
    ONE_PERSON = "one_person"
    MOVE_LEFT = "move_left"
    MOVE_RIGHT = "move_right"
    MOVE_UP = "move_up"
    MOVE_DOWN = "move_down"
    LOOK_HERE = "look_here"
    UNCOVER = "uncover"
    MORE_LIGHT = "more_light"
    LESS_LIGHT = "less_light"
    HOLD_STILL = "hold_still"

    @property
    def text(self) -> str:
        """What to say, in plain English."""
        return _TEXTS[self]


_TEXTS = {
    Fault.NOBODY: "step in front of the camera",
    Fault.MOVE_BACK: "move back a little",
    Fault.COME_CLOSER: "come closer",
    Fault.ONE_PERSON: "one person, please",
    Fault.MOVE_LEFT: "a little to the left",
    Fault.MOVE_RIGHT: "a little to the right",
    Fault.MOVE_UP: "a little higher",
    Fault.MOVE_DOWN: "a little lower",
    Fault.LOOK_HERE: "look at the camera",
    Fault.UNCOVER: "keep hands and hair off the face",
    Fault.MORE_LIGHT: "more light",
    Fault.LESS_LIGHT: "too bright",
    Fault.HOLD_STILL: "hold still",
}
