"""The mirror: pictures are asked of the hub while a visit wants them, and given one by one."""

import asyncio
from collections.abc import Callable

import structlog

from denseface.service.client import PublishedPreview
from denseface.service.errors import ServiceError
from denseface.service.kiosk.conductor.ports import Hub
from denseface.service.kiosk.page_messages import MirrorHead
from denseface.service.protocol.hint import Hint

__all__ = ["MirrorFeed"]

_AGAIN_S = 0.5
"""Time until pictures are asked for again where they ended, seconds."""


class MirrorFeed:
    """Keeps the newest picture alone. One is given for each `next`: the page draws it meanwhile.

    Parameters
    ----------
    give : sends a picture to the page of the visit
    hint : takes what the gate says of each picture
    """

    def __init__(
        self, hub: Hub, sensor: str | None, give: Callable[[MirrorHead, bytes], None],
        hint: Callable[[Hint], None],
    ) -> None:
        self._hub, self._sensor = hub, sensor
        self._give, self._hint = give, hint
        self._task: asyncio.Task[None] | None = None
        self._newest: PublishedPreview | None = None
        self._wanted = False

    @property
    def on(self) -> bool:
        """Whether pictures are asked for."""
        return self._task is not None

    def start(self) -> None:
        """Ask for pictures from now on."""
        if self._task is None:
            self._newest, self._wanted = None, False
            self._task = asyncio.create_task(self._follow())

    def stop(self) -> None:
        """Ask for none any more, and forget the last one."""
        if self._task is not None:
            self._task.cancel()
            self._task = self._newest = None
            self._wanted = False

    def next(self) -> None:
        """Give the newest picture, as soon as there is one that was not given."""
        self._wanted = self.on
        self._give_newest()

    def _give_newest(self) -> None:
        preview = self._newest
        if preview is None or not self._wanted:
            return
        self._newest, self._wanted = None, False
        width, height = preview.size
        self._give(MirrorHead(timestamp_us=preview.timestamp_us, width=width, height=height),
                   preview.jpeg if preview.jpeg is not None else _jpeg(preview))

    async def _follow(self) -> None:
        while True:
            try:
                async for preview in self._hub.previews(sensor=self._sensor):
                    self._take(preview)
            except ServiceError as error:
                structlog.get_logger("kiosk").warning("no mirror", reason=str(error))
            await asyncio.sleep(_AGAIN_S)

    def _take(self, preview: PublishedPreview) -> None:
        self._newest = preview
        self._give_newest()
        if preview.hint is not None:
            found = preview.hint
            self._hint(Hint(timestamp_us=found.timestamp_us, codes=found.codes, text=found.text,
                            measures=dict(found.measures)))


def _jpeg(preview: PublishedPreview) -> bytes:
    """Make a JPEG of a sensor's that sends pixels."""
    import cv2

    _, encoded = cv2.imencode(".jpg", cv2.cvtColor(preview.image, cv2.COLOR_RGB2BGR))
    return encoded.tobytes()
