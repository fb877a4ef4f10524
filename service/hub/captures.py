"""Where each capture stands, and the only way to change it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import structlog

from denseface.service.errors import StoreError
from denseface.service.protocol.states import (
    IN_MEMORY,
    TRANSITIONS,
    CaptureEvent,
    CaptureState,
    advance,
)
from denseface.service.storage import FolderStore, WriteResult


class Captures:
    """States of captures: those that a restart forgets are here, the others in the store's rows."""

    def __init__(self, store: FolderStore) -> None:
        self._store = store
        self._in_memory: dict[str, CaptureState] = {}

    def state(self, capture_id: str) -> CaptureState | None:
        """Return a capture's state, None for an unknown one; StoreError where it is unreadable."""
        if state := self._in_memory.get(capture_id):
            return state
        row = self._store.find(capture_id)
        return row.state if row else None

    def allows(self, capture_id: str, event: CaptureEvent) -> bool:
        """Whether an event can happen to a capture now; raises as `state`."""
        return (self.state(capture_id), event) in TRANSITIONS

    def advance(self, capture_id: str, event: CaptureEvent) -> None:
        """Change a state by an event that changes no row; TransitionError where it cannot be."""
        self._note(capture_id, advance(self.state(capture_id), event))

    @contextmanager
    def transition(self, event: CaptureEvent, *capture_ids: str) -> Iterator[CaptureState]:
        """Change states by an event that changes rows: within, the store writes the state given.

        Where it raises, the captures stay as they were. Raises as `advance`.
        """
        (after,) = {advance(self.state(capture_id), event) for capture_id in capture_ids}
        yield after
        for capture_id in capture_ids:
            self._note(capture_id, after)

    def save(
        self, event: CaptureEvent, written: Sequence[WriteResult]
    ) -> Iterator[tuple[WriteResult, Exception | None]]:
        """Give written files their rows, and yield each with its error or None; errors come first.

        The event is FRAME_SAVED or FACE_SAVED.
        """
        yield from ((one, one.error) for one in written if one.error)
        if good := [one for one in written if one.error is None]:
            yield from self._save_rows(event, good)

    def _save_rows(
        self, event: CaptureEvent, written: Sequence[WriteResult]
    ) -> Iterator[tuple[WriteResult, StoreError | None]]:
        """Write rows with one sync of the database, or one by one where that fails."""
        write = self._store.accept if event is CaptureEvent.FRAME_SAVED else self._store.finish
        try:
            with self.transition(event, *(one.pending.capture_id for one in written)) as state:
                write(written, state)
        except StoreError as error:
            if len(written) == 1:
                yield written[0], error
                return
            structlog.get_logger("hub").warning("rows are written one by one", reason=str(error))
        else:
            yield from ((one, None) for one in written)
            return
        for one in written:
            yield from self._save_rows(event, [one])

    def _note(self, capture_id: str, state: CaptureState) -> None:
        if state in IN_MEMORY:
            self._in_memory[capture_id] = state
        else:
            self._in_memory.pop(capture_id, None)
