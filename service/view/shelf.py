"""What was told of items and is kept, so that going back and forth is quick; bounded in bytes."""

import asyncio
from collections import Counter, OrderedDict
from collections.abc import Sequence

from denseface.service.view.items import Item
from denseface.service.view.messages import ItemHead
from denseface.service.view.telling import Told, tell

__all__ = ["Shelf", "short_names"]

_MAX_BYTES = 256 * 2**20
"""Of all that is kept: a thousand faces, or a few large meshes."""


class Shelf:
    """Items by their place; one frame is made at a time.

    Parameters
    ----------
    items : what can be looked at
    max_bytes : of what is kept
    """

    def __init__(self, items: Sequence[Item], max_bytes: int = _MAX_BYTES) -> None:
        self._items = items
        self._names = short_names([item.head.name for item in items])
        self._max_bytes = max_bytes
        self._kept: OrderedDict[tuple[int, int], Told] = OrderedDict()
        self._bytes = 0
        self._one = asyncio.Lock()

    @property
    def heads(self) -> tuple[ItemHead, ...]:
        """All items, in order, each by a name that is as short as it can be."""
        return tuple(item.head.model_copy(update={"name": name})
                     for item, name in zip(self._items, self._names, strict=True))

    async def told(self, item: int, number: int) -> Told:
        """Give what is told of a frame.

        Raises
        ------
        LookupError
            There is no such item.
        UsageError
            It has no such frame.
        """
        if not 0 <= item < len(self._items):
            raise LookupError(item)
        async with self._one:
            key = item, number
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
            told = await asyncio.to_thread(tell, self._items[item], number,
                                           self._names[item])
            self._keep(key, told)
            return told

    def _keep(self, key: tuple[int, int], told: Told) -> None:
        self._kept[key] = told
        self._bytes += _size(told)
        while self._bytes > self._max_bytes and len(self._kept) > 1:
            self._bytes -= _size(self._kept.popitem(last=False)[1])


def short_names(names: Sequence[str]) -> list[str]:
    """Give the last part of each path, and of those that are alike as many more as tell them apart.

    Where two are the same altogether, they stay so.
    """
    parts = [tuple(part for part in name.split("/") if part) or (name,) for name in names]
    takes = [1] * len(parts)
    for _ in range(max(map(len, parts), default=0)):
        tails = Counter(part[-take:] for part, take in zip(parts, takes, strict=True))
        takes = [take + 1 if tails[part[-take:]] > 1 else take
                 for part, take in zip(parts, takes, strict=True)]
    return ["/".join(part[-take:]) for part, take in zip(parts, takes, strict=True)]


def _size(told: Told) -> int:
    return len(told.shape) + len(told.picture) + len(told.seen.report)
