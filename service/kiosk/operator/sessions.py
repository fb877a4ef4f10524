"""Who is logged in, and how often a token may be tried: pure over the time."""

import hashlib
import secrets
from dataclasses import dataclass

from denseface.service.errors import ServiceError
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["IDLE_S", "LONGEST_S", "Sessions", "TooManyTriesError"]

LONGEST_S = 12 * 3600.0
"""Longest session, seconds: a day at work."""
IDLE_S = 3600.0
"""Time without a request after which a session ends, seconds."""
_MAX_SESSIONS = 16
"""A further one ends the oldest."""
_SESSION_BYTES = 32
_FREE_TRIES = 3
"""Wrong tokens of one address before it has to wait."""
_LONGEST_WAIT_S = 300.0
"""Of one address: each wrong token doubles the wait, from a second, seconds."""
_ALL_BURST, _ALL_RATE = 30.0, 0.2
"""Wrong tokens of all addresses together, at once and a second in the long run."""
_MAX_ADDRESSES = 4096


class TooManyTriesError(ServiceError, PermissionError):
    """Too many wrong tokens.

    Attributes
    ----------
    wait_s : seconds until another may be tried
    """

    def __init__(self, wait_s: float) -> None:
        super().__init__(f"too many tries: wait {wait_s:.0f} s")
        self.wait_s = wait_s


@dataclass
class _Tries:
    wrong: int = 0
    not_before: float = 0.0


@dataclass
class _Session:
    token_digest: str
    began: float
    seen: float


class Sessions:
    """Sessions of one kiosk, in memory alone; `now` is a monotonic time in seconds."""

    def __init__(self, now: float) -> None:
        self._sessions: BoundedDict[str, _Session] = BoundedDict(_MAX_SESSIONS)
        self._tries: BoundedDict[str, _Tries] = BoundedDict(_MAX_ADDRESSES)
        self._all = TokenBucket(_ALL_BURST, _ALL_RATE, now)

    def may_try(self, address: str, now: float) -> None:
        """Ask before a token is looked at; TooManyTriesError where it may not be."""
        self._all.refill(now)
        wait_s = self._tries.get(address, _Tries()).not_before - now
        if self._all.tokens < 1:
            wait_s = max(wait_s, (1 - self._all.tokens) / _ALL_RATE)
        if wait_s > 0:
            raise TooManyTriesError(wait_s)

    def wrong(self, address: str, now: float) -> None:
        """Note that a wrong token came from an address."""
        self._all.take(now)
        tries = self._tries.setdefault(address, _Tries())
        tries.wrong += 1
        if (beyond := tries.wrong - _FREE_TRIES) >= 0:
            tries.not_before = now + min(2.0 ** min(beyond, 20), _LONGEST_WAIT_S)

    def begin(self, address: str, token_digest: str, now: float) -> str:
        """Begin a session after the right token; give its secret, which is not kept."""
        self._tries.pop(address, None)
        secret = secrets.token_urlsafe(_SESSION_BYTES)
        self._sessions[_key(secret)] = _Session(token_digest, now, now)
        return secret

    def knows(self, secret: str, token_digest: str, now: float) -> bool:
        """Say whether a session is good, which goes on by it: its token must still be the one."""
        key = _key(secret)
        session = self._sessions.get(key)
        if session is None:
            return False
        if (now - session.began >= LONGEST_S or now - session.seen >= IDLE_S
                or session.token_digest != token_digest):
            del self._sessions[key]
            return False
        session.seen = now
        return True

    def end(self, secret: str) -> None:
        """End a session; harmless where there is none."""
        self._sessions.pop(_key(secret), None)


def _key(secret: str) -> str:
    return hashlib.sha256(secret.encode(errors="surrogateescape")).hexdigest()
