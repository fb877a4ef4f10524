"""Frames that were kept and that no worker was given yet, in memory."""

from collections.abc import Iterable

from denseface.service.storage.records import FrameRecord

__all__ = ["FrameCache"]

_BYTES = 64 * 2**20
"""Of all images together; what comes when there is no room is read from its file."""


class FrameCache:
    """As many as there is room for."""

    def __init__(self) -> None:
        self._frames: dict[str, FrameRecord] = {}
        self._room = _BYTES

    def add(self, frames: Iterable[FrameRecord]) -> None:
        """Hold frames that are safe."""
        for kept in frames:
            if self._room >= (size := _size(kept)):
                self._room -= size
                self._frames[kept.message.capture_id] = kept

    def pop(self, capture_id: str) -> FrameRecord | None:
        """Give a frame away; None where it is not here."""
        kept = self._frames.pop(capture_id, None)
        if kept:
            self._room += _size(kept)
        return kept


def _size(kept: FrameRecord) -> int:
    return sum(array.nbytes for array in kept.arrays.values())
