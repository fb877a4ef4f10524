"""What was pressed, seen and kept, and whether it fits together.

The three logs are written by three parties that know nothing of each other: the presser, the
subscriber, and the hub's own disk at the end.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import pairwise

__all__ = ["JUMP", "Answer", "History", "Kept", "Seen", "violations"]

JUMP = 1000
"""Numbers that the store leaves out where it had to mend rows at its start (docs/wire.md)."""


class Answer(StrEnum):
    """What a presser was told in the end."""

    ACCEPTED = "accepted"
    REFUSED = "refused"
    UNKNOWN = "unknown"
    """Nothing, however often it asked: the capture may exist or not."""
    WITHDRAWN = "withdrawn"
    """An operator asked for its removal and was not told that it is gone: it may be or not."""
    REMOVED = "removed"
    """An operator was told that it is gone."""


_WITHDRAWN = (Answer.WITHDRAWN, Answer.REMOVED)


@dataclass(frozen=True)
class Seen:
    """An outcome as a subscriber got it."""

    epoch: str
    sequence: int
    capture_id: str
    state: str
    """done, failed or dead."""


@dataclass(frozen=True)
class Kept:
    """A capture on the hub's disk at the end."""

    capture_id: str
    state: str
    sequence: int | None
    """Of its outcome."""
    sound: bool
    """Its face, or the frame of a dead letter, is whole and of this capture."""


@dataclass
class History:
    """All that is known of a run; lists in the order of events."""

    pressed: dict[str, Answer] = field(default_factory=dict)
    followed: list[Seen] = field(default_factory=list)
    """By a subscriber of the client library, over all its restarts."""
    published: list[Seen] = field(default_factory=list)
    """As they came from the publications alone; some may be missing, after a hub was killed."""
    kept: list[Kept] = field(default_factory=list)
    damaged: frozenset[str] = frozenset()
    """Captures whose files the run spoiled on purpose: their frame may be gone, their face may have
    been made again under a new number."""


def violations(history: History) -> list[str]:
    """Say in one line each what must not be; nothing where all is well."""
    return [*_promises(history), *_inventions(history), *_order(history.followed, history.damaged),
            *_misses(history), *_numbers(history), *_publications(history)]


def _promises(history: History) -> Iterator[str]:
    """Every accepted id ended as exactly one visible face or one dead letter."""
    kept = {one.capture_id: one for one in history.kept}
    for capture_id, count in Counter(one.capture_id for one in history.kept).items():
        if count > 1:
            yield f"{capture_id}: kept {count} times"
    for capture_id, answer in history.pressed.items():
        one = kept.get(capture_id)
        if answer is Answer.ACCEPTED and one is None:
            yield f"{capture_id}: accepted and lost"
        if answer is Answer.REFUSED and one is not None:
            yield f"{capture_id}: refused, and yet {one.state}"
        if answer is Answer.REMOVED and one is not None:
            yield f"{capture_id}: removed, and yet {one.state}"
        if one is None:
            continue
        if one.state not in ("done", "dead") or one.sequence is None:
            yield f"{capture_id}: ended as {one.state}, a face or a dead letter expected"
        elif not one.sound and capture_id not in history.damaged:
            yield f"{capture_id}: {one.state}, but its file is not sound"


def _inventions(history: History) -> Iterator[str]:
    """Nothing appears that was not pressed."""
    for where, ids in (("kept", [one.capture_id for one in history.kept]),
                       ("followed", [one.capture_id for one in history.followed]),
                       ("published", [one.capture_id for one in history.published])):
        for capture_id in sorted(set(ids) - set(history.pressed)):
            yield f"{capture_id}: {where} and never pressed"


def _order(seen: Sequence[Seen], damaged: frozenset[str]) -> Iterator[str]:
    """Each id once, in the order of its numbers."""
    for before, after in pairwise(seen):
        if after.epoch != before.epoch:
            yield f"{after.capture_id}: the epoch changed after {before.sequence}"
        elif after.sequence <= before.sequence:
            yield f"{after.capture_id}: number {after.sequence} came after {before.sequence}"
    for capture_id, count in Counter(one.capture_id for one in seen).items():
        if count > 1 and capture_id not in damaged:
            yield f"{capture_id}: visible {count} times"


def _misses(history: History) -> Iterator[str]:
    """Whoever followed saw each outcome that stands, as it stands."""
    last = {one.capture_id: one for one in history.followed}
    kept = {one.capture_id: one for one in history.kept}
    for one in history.kept:
        seen = last.get(one.capture_id)
        if seen is None:
            yield f"{one.capture_id}: {one.state}, and no subscriber saw it"
        elif (seen.sequence, seen.state) != (one.sequence, one.state):
            yield (f"{one.capture_id}: seen as {seen.state} {seen.sequence}, "
                   f"kept as {one.state} {one.sequence}")
    for capture_id in last.keys() - kept.keys():
        if history.pressed.get(capture_id) not in _WITHDRAWN:
            yield f"{capture_id}: seen and not kept"


def _numbers(history: History) -> Iterator[str]:
    """No number is missing but those of outcomes that were withdrawn, and the store's jumps."""
    numbers = {one.sequence for one in history.kept if one.sequence is not None}
    withdrawn = {one.sequence for one in history.followed if one.capture_id in history.damaged
                 or history.pressed.get(one.capture_id) in _WITHDRAWN}
    for before, after in pairwise([0, *sorted(numbers | withdrawn)]):
        if (after - before - 1) % JUMP and not history.damaged:
            yield f"numbers {before + 1} to {after - 1} belong to no outcome"


def _publications(history: History) -> Iterator[str]:
    """A number is published once, and as what was followed under it."""
    followed = {(one.epoch, one.sequence): one for one in history.followed}
    for (epoch, sequence), count in Counter(
            (one.epoch, one.sequence) for one in history.published).items():
        if count > 1:
            yield f"number {sequence} of epoch {epoch} was published {count} times"
    for one in history.published:
        other = followed.get((one.epoch, one.sequence), one)
        if other != one and one.capture_id not in history.damaged:
            yield f"{one.capture_id}: published as {one.sequence}, which is {other.capture_id}"
