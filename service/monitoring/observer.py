"""All that the hub's process measures of itself, and how it shows it."""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import structlog

from denseface.service.monitoring.board import Board, Picture
from denseface.service.monitoring.figures import Figures
from denseface.service.monitoring.message_watch import MessageWatch
from denseface.service.protocol.messages import Status
from denseface.service.protocol.outgoing import Output, Publish
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.background import Background

__all__ = ["Observer", "folder_bytes"]

_MEASURE_S = 60.0
"""Time between two looks at how much is kept, seconds."""


class Observer:
    """Is told by the hub's loop what happens.

    Parameters
    ----------
    data : the folder whose size is measured
    """

    def __init__(self, data: Path) -> None:
        self.figures = Figures()
        self.board = Board()
        self._watch = MessageWatch(self.figures.counters, self.figures.latencies)
        self._data = data
        self._measure = Background[int]("usage")
        self._measure_due = 0.0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        self._measure.close()

    def saw(self, now: float, packet: Packet | None, outputs: Sequence[Output]) -> None:
        """Take note of what a message, or a tick where there is none, brought about."""
        self._watch.saw(now, packet, outputs)

    def ticked(
        self, now: float, outputs: Sequence[Output], subscriptions: Mapping[str, int]
    ) -> None:
        """Show how things stand, at each status that a tick gave out."""
        self._measured(now)
        for output in outputs:
            message = output.packet.message
            if isinstance(output, Publish) and isinstance(message, Status):
                self.board.picture = Picture(
                    now, message, tuple(self.figures.counters.items()),
                    self.figures.latencies.stages(), dict(subscriptions))

    def _measured(self, now: float) -> None:
        if self._measure.ended():
            try:
                self.figures.kept_bytes = self._measure.take()
            except OSError as error:
                structlog.get_logger("hub").warning(
                    "what is kept cannot be measured", reason=str(error))
        elif not self._measure and now >= self._measure_due:
            self._measure_due = now + _MEASURE_S
            self._measure.start(lambda: folder_bytes(self._data))


def folder_bytes(folder: Path) -> int:
    """Give the size of all files under a folder; one that goes away meanwhile has none."""
    total = 0
    with os.scandir(folder) as entries:
        for entry in entries:
            try:
                if entry.is_dir(follow_symlinks=False):
                    total += folder_bytes(Path(entry.path))
                else:
                    total += entry.stat(follow_symlinks=False).st_size
            except FileNotFoundError:
                continue
    return total
