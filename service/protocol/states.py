"""The life of a capture, as one table."""

from enum import StrEnum

__all__ = ["TRANSITIONS", "CaptureEvent", "CaptureState", "advance"]


class CaptureState(StrEnum):
    """Where a capture stands. From ACCEPTED on it is on the disk."""

    PRESSED = "pressed"
    """The sensor was asked for a frame."""
    KEEPING = "keeping"
    """The frame came and is being written."""
    REFUSED = "refused"
    """No frame came or it could not be kept: forgotten, the id may be pressed again."""
    ACCEPTED = "accepted"
    """Safe on disk, waits for a worker."""
    WORKING = "working"
    """A worker holds it."""
    CONCLUDING = "concluding"
    """The face came and is being written."""
    DONE = "done"
    """A face was published."""
    FAILED = "failed"
    """Published as "no face in this frame"."""
    DEAD = "dead"
    """Given up after repeated attempts; the frame is kept."""
    REMOVED = "removed"
    """By an operator or after the retention: unknown to all, the id may be pressed again. The row
    stays until the files are gone."""


class CaptureEvent(StrEnum):
    """What may happen to a capture."""

    RECEIVED = "received"
    """The frame came."""
    STORED = "stored"
    """The frame is safe."""
    NOT_TAKEN = "not taken"
    """The sensor failed, went away or took too long, or the disk is full."""
    DISPATCHED = "dispatched"
    LOST = "lost"
    """The worker went silent or stumbled; attempts remain."""
    EXHAUSTED = "exhausted"
    """As LOST, but no attempt remains; or the stored frame cannot be read."""
    HANDED_BACK = "handed back"
    """The worker was told to stop before it was through; counts for no attempt."""
    RESULT = "result"
    """A face came."""
    CONCLUDED = "concluded"
    """The face is safe."""
    NOT_KEPT = "not kept"
    """The face is none, or so many wait for a disk that refuses them that this one is let go."""
    REJECTED = "rejected"
    """A worker says that no attempt would find a face."""
    DAMAGED = "damaged"
    """The stored face cannot be read: it is made again from its frame."""
    RETRIED = "retried"
    """An operator wants all attempts made again."""
    EXPIRED = "expired"
    """The retention has passed since the outcome."""
    PURGED = "purged"
    """An operator wants it gone."""


_S, _E = CaptureState, CaptureEvent

TRANSITIONS: dict[tuple[CaptureState, CaptureEvent], CaptureState] = {
    # What is being written cannot be stopped: a purge waits for it, a time-out does not count.
    (_S.PRESSED, _E.RECEIVED): _S.KEEPING,
    (_S.PRESSED, _E.NOT_TAKEN): _S.REFUSED,
    (_S.KEEPING, _E.STORED): _S.ACCEPTED,
    (_S.KEEPING, _E.NOT_TAKEN): _S.REFUSED,
    (_S.ACCEPTED, _E.DISPATCHED): _S.WORKING,
    (_S.ACCEPTED, _E.EXHAUSTED): _S.DEAD,
    # From a worker that was thought lost.
    (_S.ACCEPTED, _E.RESULT): _S.CONCLUDING,
    (_S.ACCEPTED, _E.REJECTED): _S.FAILED,
    (_S.WORKING, _E.RESULT): _S.CONCLUDING,
    (_S.WORKING, _E.REJECTED): _S.FAILED,
    (_S.WORKING, _E.LOST): _S.ACCEPTED,
    (_S.WORKING, _E.EXHAUSTED): _S.DEAD,
    (_S.WORKING, _E.HANDED_BACK): _S.ACCEPTED,
    (_S.CONCLUDING, _E.CONCLUDED): _S.DONE,
    (_S.CONCLUDING, _E.NOT_KEPT): _S.ACCEPTED,
    # The outcome is withdrawn, its sequence number used up; the next one gets a new number. So
    # exactly one outcome stands for an id, the one with the highest number seen.
    (_S.DONE, _E.DAMAGED): _S.ACCEPTED,
    (_S.DEAD, _E.RETRIED): _S.ACCEPTED,
    # What has no outcome never expires.
    (_S.DONE, _E.EXPIRED): _S.REMOVED,
    (_S.FAILED, _E.EXPIRED): _S.REMOVED,
    (_S.DEAD, _E.EXPIRED): _S.REMOVED,
    (_S.PRESSED, _E.PURGED): _S.REFUSED,
    (_S.ACCEPTED, _E.PURGED): _S.REMOVED,
    (_S.WORKING, _E.PURGED): _S.REMOVED,
    (_S.DONE, _E.PURGED): _S.REMOVED,
    (_S.FAILED, _E.PURGED): _S.REMOVED,
    (_S.DEAD, _E.PURGED): _S.REMOVED,
}
"""What is not here does not happen: the event is noted and dropped."""


def advance(state: CaptureState | None, event: CaptureEvent) -> CaptureState | None:
    """Give the state after an event, or None where the event means nothing in this state."""
    return TRANSITIONS.get((state, event)) if state else None
