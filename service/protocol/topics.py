"""What may be subscribed to."""

from enum import StrEnum


class Topic(StrEnum):
    """What may be subscribed to."""

    FACES = "faces"
    """`FaceDone` and `CaptureFailed`, numbered without gaps."""
    STATUS = "status"
    """`Status`, at every heartbeat."""
    PREVIEW = "preview"
    """`Preview`, ten a second at most while somebody subscribes."""
