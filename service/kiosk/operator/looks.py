"""What captures look like, for the operator: small pictures and reports, in memory alone."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass

from denseface.recon.face import Face
from denseface.service.export.render import portrait
from denseface.service.runtime.bounded_dict import BoundedDict

__all__ = ["Look", "Looks"]

_SIDE = 192
"""Width and height of a thumbnail, pixels: 96 on a screen of double density."""
_MAX_LOOKS = 100
"""Of some 40 kB each."""
_KEPT_S = 60.0
"""How long one is kept, seconds: the hub removes captures, and visitors withdraw them, unseen."""


@dataclass(frozen=True)
class Look:
    """What is shown of one face."""

    thumbnail: bytes
    """PNG."""
    report: str
    """JSON."""


class Looks:
    """Made of the hub's faces when they are asked for, one at a time; the last ones are kept.

    Parameters
    ----------
    get : gives a capture's face, as `AsyncClient.get`
    """

    def __init__(self, get: Callable[[str], Awaitable[Face]]) -> None:
        self._get = get
        self._making = asyncio.Lock()
        self._looks: BoundedDict[str, Look] = BoundedDict(_MAX_LOOKS)
        self._forgotten = 0
        """How often something was forgotten."""

    async def of(self, capture_id: str) -> Look:
        """Give the look of a capture; raises as `AsyncClient.get`."""
        async with self._making:
            if look := self._looks.get(capture_id):
                return look
            before = self._forgotten
            face = await self._get(capture_id)
            look = await asyncio.to_thread(_look, face)
            if self._forgotten == before:  # else it may be this one that was removed meanwhile
                self._looks[capture_id] = look
                asyncio.get_running_loop().call_later(
                    _KEPT_S, self._looks.pop, capture_id, None)
            return look

    def forget(self, capture_id: str) -> None:
        """Forget a capture that was removed."""
        self._forgotten += 1
        self._looks.pop(capture_id, None)

    def keep_only(self, capture_ids: frozenset[str]) -> None:
        """Forget all but these, which are all that the hub has."""
        for gone in self._looks.keys() - capture_ids:
            self.forget(gone)


def _look(face: Face) -> Look:
    return Look(portrait(face, _SIDE), face.report.model_dump_json())
