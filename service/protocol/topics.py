"""What may be subscribed to."""

from enum import StrEnum


class Topic(StrEnum):
    """What may be subscribed to."""

    FACES = "faces"
    """`FaceDone` and `CaptureFailed`, numbered without gaps."""
    STATUS = "status"
    """`Status`, at every heartbeat and where it changes."""
    PREVIEW = "preview"
    """`Preview`, up to thirty a second of each sensor while somebody subscribes."""
    HINTS = "hints"
    """`Hints`, about ten a second of each sensor while somebody subscribes."""
