"""A folder of image pairs as a source."""

from collections.abc import Iterator
from pathlib import Path

from denseface.capture.calibration import ChosenCalibration
from denseface.capture.frame import RgbdFrame
from denseface.capture.image_pair._layouts import recognised
from denseface.capture.image_pair._pair import NOTHING_SAID, PairReading, PairSource, read_pair

__all__ = ["FolderSource"]


class FolderSource(PairSource):
    """The pairs of a folder in a layout that is known; each file is read when it is asked for."""

    def __init__(
        self, folder: Path, chosen: ChosenCalibration | None = None,
        reading: PairReading = NOTHING_SAID,
    ) -> None:
        """Recognise a folder.

        Parameters
        ----------
        chosen : a calibration that wins over the folder's own
        reading : what it says wins over what the layout says; `chosen` wins over its own
        """
        self.uri = str(folder)
        self._name = Path(folder).absolute().name
        layout = recognised(Path(folder))
        own, chosen = layout.reading, chosen or reading.chosen
        self._pairs = layout.pairs
        self._reading = reading._replace(
            unit_mm=own.unit_mm if reading.unit_mm is None else reading.unit_mm,
            registered=own.registered if reading.registered is None else reading.registered,
            chosen=chosen or own.chosen, rounding=own.rounding)
        self.frame_count = len(self._pairs)
        self.layout = layout.name

    def __iter__(self) -> Iterator[RgbdFrame]:
        return self.frames_from(0)

    def frames_from(self, number: int) -> Iterator[RgbdFrame]:
        """Read the frames from a number on, from 0, without those before it."""
        for at, pair in enumerate(self._pairs[number:], number):
            frame = read_pair(pair, self._reading).with_source(f"{self._name}#{at}")
            yield self.settled(frame)

    def close(self) -> None:
        """Nothing is held open."""
