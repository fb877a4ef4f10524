"""Frames in memory that were accepted and not yet sent to a worker."""

from collections.abc import Iterable

from denseface.service.storage.records import FrameRecord

_MAX_BYTES = 64 * 2**20
"""Of all arrays together; a frame beyond it is read from its file when it is needed."""


class FrameCache:
    """As many frames as `_MAX_BYTES` holds."""

    def __init__(self) -> None:
        self._frames: dict[str, FrameRecord] = {}
        self._free_bytes = _MAX_BYTES

    def add(self, frames: Iterable[FrameRecord]) -> None:
        """Hold those frames for which there is room."""
        for record in frames:
            if self._free_bytes >= (size := _array_bytes(record)):
                self._free_bytes -= size
                self._frames[record.message.capture_id] = record

    def get(self, capture_id: str) -> FrameRecord | None:
        """Give a frame, which stays here; None where it is not here."""
        return self._frames.get(capture_id)

    def pop(self, capture_id: str) -> FrameRecord | None:
        """Remove and give a frame; None where it is not here."""
        record = self._frames.pop(capture_id, None)
        if record:
            self._free_bytes += _array_bytes(record)
        return record


def _array_bytes(record: FrameRecord) -> int:
    return sum(array.nbytes for array in record.arrays.values())
