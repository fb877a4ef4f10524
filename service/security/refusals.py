"""What the sender of a message that is refused is told, and how often.

Who has no key that is allowed is told nothing. An answer is about as long as what it answers, or
short, and there are few of them: nobody is flooded by what somebody else says in their name.
"""

import time
from collections.abc import Callable, Sequence

from denseface.service.errors import RemoteProtocolError
from denseface.service.protocol import messages
from denseface.service.protocol.message_base import BaseMessage, BaseRequest
from denseface.service.protocol.wire import Buffer, readable
from denseface.service.runtime.bounded_dict import BoundedDict
from denseface.service.runtime.token_bucket import TokenBucket

__all__ = ["Refusals"]

_BURST = 32.0
"""Answers that one sender gets at once."""
_PER_S = 4.0
"""Answers a second that one sender gets in the long run."""
_MAX_SENDERS = 1000
"""Senders whose answers are counted."""
_SHORT_BYTES = 256
"""Text that an answer may have, however short the message was, bytes."""
_MAX_BYTES = 1000
"""Text that it has at most, bytes."""

_SAYS_NO_REQUEST = {
    kind.model_fields["kind"].default
    for kind in messages.TO_HUB if not issubclass(kind, BaseRequest)}


class Refusals:
    """Makes the answers to messages that are malformed.

    Parameters
    ----------
    clock : seconds, monotonic
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._budgets: BoundedDict[str | bytes, TokenBucket] = BoundedDict(_MAX_SENDERS)

    def answer(
        self, sender: str | bytes, parts: Sequence[Buffer], error: RemoteProtocolError
    ) -> BaseMessage | None:
        """Say what is wrong with a message; None where its sender was told too much lately.

        Parameters
        ----------
        sender : fingerprint of the sender's key; where it needed none, what names its connection
        parts : of the message, as far as they were kept
        """
        now = self._clock()
        if not self._budgets.setdefault(sender, TokenBucket(_BURST, _PER_S, now)).take(now):
            return None
        said = readable(parts[0]) if parts else {}
        most = min(max(_SHORT_BYTES, sum(map(len, parts))), _MAX_BYTES)
        text = f"refused: {error}".encode()[:most].decode(errors="ignore")
        if str(said.get("kind")) in _SAYS_NO_REQUEST:
            return messages.Denied(message=text)
        return messages.RequestFailed(request=_number(said), message=text)


def _number(said: dict[str, object]) -> int:
    """Give the number of a request; 0 where it cannot be read."""
    number = said.get("request")
    return number if type(number) is int and 0 <= number < 2**63 else 0
