"""The life of a capture, as one table.

Nothing else says which state follows: the hub asks `advance` for every change of a state, and so
does the store where it makes rows again from files.
"""

from enum import StrEnum


class CaptureState(StrEnum):
    """Where a capture stands. From ACCEPTED on it is on the disk."""

    PRESSED = "pressed"
    """The sensor was asked for a frame."""
    SAVING_FRAME = "saving frame"
    """The frame came and is being written."""
    REFUSED = "refused"
    """No frame came or it could not be saved: forgotten, the id may be pressed again."""
    ACCEPTED = "accepted"
    """Safe on disk, waits for a worker."""
    WORKING = "working"
    """A worker holds it."""
    SAVING_FACE = "saving face"
    """The face came and is being written, or waits for a disk that refuses it."""
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

    PRESSED = "pressed"
    """Somebody presses, and there is a sensor to ask."""
    FRAME_RECEIVED = "frame received"
    FRAME_SAVED = "frame saved"
    REFUSED = "refused"
    """The sensor failed, went away or took too long, or the disk is full."""
    DISPATCHED = "dispatched"
    LOST = "lost"
    """The worker went silent, or failed otherwise than for want of a face."""
    EXHAUSTED = "exhausted"
    """No attempt is left, or the frame on disk cannot be read."""
    HANDED_BACK = "handed back"
    """The worker was told to stop before it was through; counts for no attempt."""
    RESULT = "result"
    """A face came."""
    FACE_SAVED = "face saved"
    FACE_DROPPED = "face dropped"
    """The disk refuses so many faces that this one is let go."""
    REJECTED = "rejected"
    """A worker says that no attempt would find a face."""
    DAMAGED = "damaged"
    """The face on disk cannot be read: it is made again from its frame."""
    RETRIED = "retried"
    """An operator wants all attempts made again."""
    EXPIRED = "expired"
    """The retention has passed since the outcome."""
    PROMISED = "promised"
    """So much time has passed since the press as a consent promised."""
    PURGED = "purged"
    """An operator wants it gone, or whoever pressed it."""


_S, _E = CaptureState, CaptureEvent

TRANSITIONS: dict[tuple[CaptureState | None, CaptureEvent], CaptureState] = {
    (None, _E.PRESSED): _S.PRESSED,
    (_S.PRESSED, _E.FRAME_RECEIVED): _S.SAVING_FRAME,
    (_S.PRESSED, _E.REFUSED): _S.REFUSED,
    (_S.PRESSED, _E.PURGED): _S.REFUSED,
    # A frame that is being written cannot be stopped: a purge waits for it, no time-out counts.
    (_S.SAVING_FRAME, _E.FRAME_SAVED): _S.ACCEPTED,
    (_S.SAVING_FRAME, _E.REFUSED): _S.REFUSED,
    (_S.ACCEPTED, _E.DISPATCHED): _S.WORKING,
    (_S.ACCEPTED, _E.EXHAUSTED): _S.DEAD,
    # From a worker that was thought lost.
    (_S.ACCEPTED, _E.RESULT): _S.SAVING_FACE,
    (_S.ACCEPTED, _E.REJECTED): _S.FAILED,
    (_S.WORKING, _E.RESULT): _S.SAVING_FACE,
    (_S.WORKING, _E.REJECTED): _S.FAILED,
    (_S.WORKING, _E.LOST): _S.ACCEPTED,
    (_S.WORKING, _E.HANDED_BACK): _S.ACCEPTED,
    (_S.SAVING_FACE, _E.FACE_SAVED): _S.DONE,
    (_S.SAVING_FACE, _E.FACE_DROPPED): _S.ACCEPTED,
    # The outcome is withdrawn, its sequence number used up; the next one gets a new number. So
    # exactly one outcome stands for an id, the one with the highest number seen.
    (_S.DONE, _E.DAMAGED): _S.ACCEPTED,
    (_S.DEAD, _E.RETRIED): _S.ACCEPTED,
    # What has no outcome never expires.
    (_S.DONE, _E.EXPIRED): _S.REMOVED,
    (_S.FAILED, _E.EXPIRED): _S.REMOVED,
    (_S.DEAD, _E.EXPIRED): _S.REMOVED,
    (_S.ACCEPTED, _E.PROMISED): _S.REMOVED,
    (_S.WORKING, _E.PROMISED): _S.REMOVED,
    (_S.DONE, _E.PROMISED): _S.REMOVED,
    (_S.FAILED, _E.PROMISED): _S.REMOVED,
    (_S.DEAD, _E.PROMISED): _S.REMOVED,
    (_S.ACCEPTED, _E.PURGED): _S.REMOVED,
    (_S.WORKING, _E.PURGED): _S.REMOVED,
    # What is being written is settled first; what the disk refused goes.
    (_S.SAVING_FACE, _E.PURGED): _S.REMOVED,
    (_S.DONE, _E.PURGED): _S.REMOVED,
    (_S.FAILED, _E.PURGED): _S.REMOVED,
    (_S.DEAD, _E.PURGED): _S.REMOVED,
}
"""State, None for an id that nobody knows, and event -> state. What is not here cannot happen."""

IN_MEMORY = frozenset({_S.PRESSED, _S.SAVING_FRAME, _S.WORKING, _S.SAVING_FACE})
"""States that a restart forgets: of the former two nothing is left, the others are ACCEPTED again.
"""


class TransitionError(RuntimeError):
    """An event came in a state in which it cannot happen: a fault of the hub."""


def advance(state: CaptureState | None, event: CaptureEvent) -> CaptureState:
    """Give the state after an event; TransitionError where it cannot happen in this state."""
    try:
        return TRANSITIONS[state, event]
    except KeyError:
        raise TransitionError(f"a capture that is {state or 'unknown'} cannot be {event}") from None
