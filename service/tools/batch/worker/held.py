"""What a worker's process keeps from one task to the next: open recordings, and its last words."""

from collections import OrderedDict
from contextlib import suppress
from pathlib import Path

from denseface.service.tools.batch.parts import Part
from denseface.service.tools.batch.worker.words import LastWords
from denseface.service.tools.frames import FrameChoice, FrameReader

__all__ = ["Held"]

_READERS = 3
"""So many recordings are held open: a worker has parts of more than one by turns."""


class Held:
    """What one process holds; each part of a recording is read on from where it is."""

    def __init__(self) -> None:
        self._readers: OrderedDict[tuple[str, int, FrameChoice], FrameReader] = OrderedDict()
        self._words: tuple[Path, LastWords] | None = None

    def words(self, folder: Path) -> LastWords:
        """Give where this process says what it does, of a batch; OSError where there is no place.

        Parameters
        ----------
        folder : of the batch
        """
        if self._words is None or self._words[0] != folder or not self._words[1].there():
            if self._words is not None:
                self._words[1].close()
            self._words = None
            self._words = folder, LastWords(folder)
        return self._words[1]

    def reader(self, part: Part, choice: FrameChoice) -> FrameReader:
        """Give what reads a part's frames."""
        key = part.source, part.begun, choice
        if key not in self._readers:
            while len(self._readers) >= _READERS:
                _close(self._readers.popitem(last=False)[1])
            self._readers[key] = FrameReader(part.source, choice)
        self._readers.move_to_end(key)
        return self._readers[key]

    def done_with(self, part: Part, choice: FrameChoice) -> None:
        """Close what read a part, where it is open."""
        reader = self._readers.pop((part.source, part.begun, choice), None)
        if reader is not None:
            _close(reader)


def _close(reader: FrameReader) -> None:
    with suppress(Exception):  # of a file that is not read any more
        reader.close()
