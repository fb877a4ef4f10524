"""How often, and with how many connections at a time, one key may connect.

A key is one machine. What it may have at a time is far more than its processes need, and leaves
places to the others. How often it may connect keeps it from trying routing ids: libzmq ends the
process of a ROUTER where a peer calls itself as libzmq would call the next one, which among 2^32
names takes months at this pace.
"""

import time
from collections.abc import Callable

from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["MAX_CONNECTIONS", "KeyLimits"]

MAX_CONNECTIONS = 128
"""Connections to one port by which one key may speak at a time."""
_BURST = 256.0
"""Handshakes that one key may make at once: all its connections, twice."""
_PER_S = 2.0
"""Handshakes a second that one key may make in the long run."""
_MAX_KEYS = 10_000
"""Keys whose handshakes are counted."""


class KeyLimits:
    """Counts the handshakes of each key.

    Parameters
    ----------
    clock : seconds, monotonic
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._budgets: BoundedDict[str, TokenBucket] = BoundedDict(_MAX_KEYS)

    def take_handshake(self, public: str) -> bool:
        """Count a handshake of a key; False where it has made too many lately."""
        now = self._clock()
        return self._budgets.setdefault(public, TokenBucket(_BURST, _PER_S, now)).take(now)
