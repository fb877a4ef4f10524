"""Links whose every change is on the disk before anybody is told of it."""

import asyncio
import time
from collections.abc import Callable

import structlog

from denseface.service.errors import StoreError
from denseface.service.kiosk.links.link_file import LinkFile
from denseface.service.kiosk.links.link_store import LinkRecord, LinkRecords, LinkStore

__all__ = ["KeptLinks"]


class KeptLinks:
    """The links of this kiosk, for one event loop; parameters as of `LinkStore`.

    A file that cannot be read is logged and its links are not known any more. Where the disk
    refuses, links are good until the kiosk ends.
    """

    def __init__(
        self, file: LinkFile, *, uses: int, lifetime_s: float,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._log = structlog.get_logger("links")
        self._file = file
        self._clock = clock
        self._writing = asyncio.Lock()
        self._unwritten = False
        """The file is not as the links are."""
        try:
            kept = file.read()
        except StoreError as error:
            self._log.warning("links of before are lost", reason=str(error))
            kept = LinkRecords()
        self._store = LinkStore(uses=uses, lifetime_s=lifetime_s, kept=kept, now=clock())

    async def make(self, capture_id: str, language: str) -> tuple[str, LinkRecord]:
        """See `LinkStore.make`."""
        made = self._store.make(capture_id, language, self._clock())
        await self._keep()
        return made

    def find(self, token: str) -> LinkRecord:
        """See `LinkStore.find`."""
        return self._store.find(token, self._clock())

    def begin(self, token: str) -> LinkRecord:
        """See `LinkStore.begin`."""
        return self._store.begin(token, self._clock())

    async def finish(self, digest: str, *, complete: bool) -> None:
        """See `LinkStore.finish`."""
        if self._store.finish(digest, self._clock(), complete=complete):
            await self._keep()

    def under_way(self, digest: str) -> bool:
        """See `LinkStore.under_way`."""
        return self._store.under_way(digest)

    def left_s(self, link: LinkRecord) -> float:
        """Give the seconds until a link expires."""
        return link.expires_at - self._clock()

    async def forget(self, capture_id: str) -> None:
        """End all links to a capture.

        Raises
        ------
        StoreError
            They are ended, but the disk refuses: their file still says of which capture they were.
        """
        if (self._store.forget(capture_id, self._clock()) or self._unwritten) and (
                error := await self._keep()):
            raise error

    async def tidy(self) -> None:
        """End what has expired, and write what could not be written."""
        if self._store.tidy(self._clock()) or self._unwritten:
            await self._keep()

    async def _keep(self) -> StoreError | None:
        """Write the file; give and log why that was not possible."""
        self._unwritten = True
        async with self._writing:
            if not self._unwritten:  # another's write had this, too
                return None
            self._unwritten = False
            try:
                await asyncio.to_thread(self._file.write, self._store.records())
            except StoreError as error:
                self._unwritten = True
                self._log.warning("links are not kept over a restart", reason=str(error))
                return error
        return None
