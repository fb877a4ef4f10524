"""The life of a capture, as one table."""

from enum import StrEnum

__all__ = ["TRANSITIONS", "CaptureEvent", "CaptureState", "advance"]


class CaptureState(StrEnum):
    """Where a capture stands. From ACCEPTED on it is on the disk."""

    PRESSED = "pressed"
    """The sensor was asked for a frame."""
    REFUSED = "refused"
    """No frame came or it could not be kept: forgotten, the id may be pressed again."""
    ACCEPTED = "accepted"
    """Safe on disk, waits for a worker."""
    WORKING = "working"
    """A worker holds it."""
    DONE = "done"
    """A face was published."""
    FAILED = "failed"
    """Published as "no face in this frame"."""
    DEAD = "dead"
    """Given up after repeated attempts; the frame is kept."""


class CaptureEvent(StrEnum):
    """What may happen to a capture."""

    STORED = "stored"
    """The frame came and is safe."""
    NOT_TAKEN = "not taken"
    """The sensor failed, went away or took too long, or the disk is full."""
    DISPATCHED = "dispatched"
    LOST = "lost"
    """The worker went silent or stumbled; attempts remain."""
    EXHAUSTED = "exhausted"
    """As LOST, but no attempt remains; or the stored frame cannot be read."""
    RESULT = "result"
    REJECTED = "rejected"
    """A worker says that no attempt would find a face."""


_S, _E = CaptureState, CaptureEvent

TRANSITIONS: dict[tuple[CaptureState, CaptureEvent], CaptureState] = {
    (_S.PRESSED, _E.STORED): _S.ACCEPTED,
    (_S.PRESSED, _E.NOT_TAKEN): _S.REFUSED,
    (_S.ACCEPTED, _E.DISPATCHED): _S.WORKING,
    (_S.ACCEPTED, _E.EXHAUSTED): _S.DEAD,
    # From a worker that was thought lost.
    (_S.ACCEPTED, _E.RESULT): _S.DONE,
    (_S.ACCEPTED, _E.REJECTED): _S.FAILED,
    (_S.WORKING, _E.RESULT): _S.DONE,
    (_S.WORKING, _E.REJECTED): _S.FAILED,
    (_S.WORKING, _E.LOST): _S.ACCEPTED,
    (_S.WORKING, _E.EXHAUSTED): _S.DEAD,
}
"""What is not here does not happen: the event is noted and dropped."""


def advance(state: CaptureState | None, event: CaptureEvent) -> CaptureState | None:
    """Give the state after an event, or None where the event means nothing in this state."""
    return TRANSITIONS.get((state, event)) if state else None
