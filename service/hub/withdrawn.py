"""Ids of captures that were withdrawn: a press of one that comes late makes no picture."""

import secrets
from collections import defaultdict
from hashlib import blake2b

from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

_MAX_WITHDRAWN = 1000
"""Ids of one key that are remembered."""
_BURST, _PER_S = 32.0, 2.0
"""Withdrawals of one key at once, and a second in the long run: each lists a folder and syncs."""


class Withdrawn:
    """What was withdrawn since the hub started, by the key that pressed it or withdrew it.

    Only hashes are kept, and none on the disk: nothing is to be left of what was withdrawn.
    """

    def __init__(self) -> None:
        self._secret = secrets.token_bytes(32)
        self._hashes: defaultdict[str, BoundedDict[bytes, None]] = defaultdict(
            lambda: BoundedDict(_MAX_WITHDRAWN))
        self._budgets: dict[str, TokenBucket] = {}
        """By key; those that may withdraw are few."""

    def take_turn(self, key: str, now: float) -> bool:
        """Count a withdrawal of a key; False where it has made too many lately."""
        return self._budgets.setdefault(key, TokenBucket(_BURST, _PER_S, now)).take(now)

    def add(self, key: str, capture_id: str) -> None:
        """Note that presses of an id with a key, given by its fingerprint, are to be refused."""
        self._hashes[key][self._hash(capture_id)] = None

    def has(self, key: str, capture_id: str) -> bool:
        """Say whether that was noted."""
        return key in self._hashes and self._hash(capture_id) in self._hashes[key]

    def _hash(self, capture_id: str) -> bytes:
        return blake2b(capture_id.encode(), key=self._secret, digest_size=16).digest()
