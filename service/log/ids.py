"""Ids of captures, which name people's pictures, replaced by what this run of the service knows.

A log is kept longer than what it tells of: an id that was purged may stay in it.
"""

import os
import re
import secrets
from collections.abc import MutableMapping
from hashlib import blake2s
from typing import Any

from structlog.typing import EventDict

from denseface.service.runtime.bounded_dict import BoundedDict

__all__ = ["IDS_VARIABLE", "IdHider"]

IDS_VARIABLE = "DENSEFACE_LOG_IDS"
"""Environment variable: `on`, or `off` for hashes in place of ids."""
_KEY_VARIABLE = "DENSEFACE_LOG_KEY"
"""Environment variable in which the processes of one service share the key of these hashes."""
_MAX_KNOWN = 10_000
_UNTOUCHED = ("timestamp", "level", "process")
_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_CALLED = re.compile(rf"(?<=\bcapture ){_WORD.pattern}")
"""An id in the text of an error."""
_FILE = re.compile(rf"(?<![A-Za-z0-9_-])({_WORD.pattern})((?:\.[0-9a-f]+)?\.(?:frame|face)\b)")
"""An id in the name of its file, and the rest of that name."""


class IdHider:
    """A processor that hashes ids: the field `capture_id`, and where they stand in other texts."""

    def __init__(self, environment: MutableMapping[str, str] = os.environ) -> None:
        """Take the key of the process that started this one, or make one for those to come."""
        self._key = environment.setdefault(_KEY_VARIABLE, secrets.token_hex(16)).encode()[:32]
        self._known: BoundedDict[str, str] = BoundedDict(_MAX_KNOWN)

    def __call__(self, _: object, __: str, event: EventDict) -> EventDict:
        """Give the event without ids."""
        if capture_id := event.get("capture_id"):
            self._known[str(capture_id)] = self._hash(str(capture_id))
        return {key: value if key in _UNTOUCHED else self._without_ids(value)
                for key, value in event.items()}

    def hide(self, text: str) -> str:
        """Give a text without ids."""
        text = _CALLED.sub(lambda found: self._hash(found[0]), text)
        text = _FILE.sub(lambda found: self._hash(found[1]) + found[2], text)
        return _WORD.sub(lambda found: self._known.get(found[0], found[0]), text)

    def _without_ids(self, value: Any) -> Any:
        if isinstance(value, str):
            return self.hide(value)
        if isinstance(value, list):
            return [self._without_ids(one) for one in value]
        return value

    def _hash(self, capture_id: str) -> str:
        return "id:" + blake2s(capture_id.encode(), key=self._key, digest_size=8).hexdigest()
