"""What a pixel of the truth shows."""

from enum import IntEnum

__all__ = ["Label"]


class Label(IntEnum):
    """What a ray met."""

    NONE = 0
    FACE = 1
    """The target's face: forehead to chin, ear to ear."""
    HEAD = 2
    """The rest of the same head: ears, hair, neck."""
    BODY = 3
    """The target's shoulders."""
    BACKGROUND = 4
    OTHER_PERSON = 5
    HAND = 6
    GLASSES = 7
