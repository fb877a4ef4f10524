"""Captures that are to be removed: asked for until the hub has answered, whoever visits by then."""

from collections import OrderedDict
from dataclasses import dataclass

from denseface.service.kiosk.visit.effects import Withdraw

__all__ = ["Withdrawals"]

_FIRST_S = 2.0
"""Before it is asked for again, seconds; each time twice as long, up to `_LONGEST_S`."""
_LONGEST_S = 30.0
_REMEMBERED = 1000
"""Captures of which it is known that they were withdrawn: a late answer about one of them means
that something may be there again."""


@dataclass
class _Asked:
    visit: int
    next_s: float
    wait_s: float = _FIRST_S


class Withdrawals:
    """What is asked for, and what was."""

    def __init__(self) -> None:
        self._pending: dict[str, _Asked] = {}
        self._done: OrderedDict[str, int] = OrderedDict()

    def ask(self, visit: int, capture_id: str, now_s: float) -> Withdraw | None:
        """Withdraw a capture, unless that is under way."""
        if capture_id in self._pending:
            return None
        self._done.pop(capture_id, None)
        self._pending[capture_id] = _Asked(visit, now_s + _FIRST_S)
        return Withdraw(visit, capture_id)

    def answered(self, capture_id: str) -> bool:
        """Note that nothing of it is left; false where nobody asked."""
        asked = self._pending.pop(capture_id, None)
        if asked is None:
            return False
        self._done[capture_id] = asked.visit
        while len(self._done) > _REMEMBERED:
            self._done.popitem(last=False)
        return True

    def came_late(self, capture_id: str, now_s: float) -> Withdraw | None:
        """Take an answer about a capture that may have been withdrawn before there was one."""
        visit = self._done.get(capture_id)
        return self.ask(visit, capture_id, now_s) if visit is not None else None

    def pending(self, capture_ids: list[str]) -> bool:
        """Whether the hub has to answer for any of these."""
        return any(one in self._pending for one in capture_ids)

    def due(self, now_s: float) -> list[Withdraw]:
        """Ask again for those that were not answered in time."""
        asked_again = []
        for capture_id, asked in self._pending.items():
            if asked.next_s <= now_s:
                asked.wait_s = min(asked.wait_s * 2, _LONGEST_S)
                asked.next_s = now_s + asked.wait_s
                asked_again.append(Withdraw(asked.visit, capture_id))
        return asked_again

    def hurry(self, now_s: float) -> None:
        """Ask for all at the next occasion: the hub is back."""
        for asked in self._pending.values():
            asked.next_s, asked.wait_s = now_s, _FIRST_S

    @property
    def next_s(self) -> float | None:
        """When `due` has something."""
        return min((asked.next_s for asked in self._pending.values()), default=None)
