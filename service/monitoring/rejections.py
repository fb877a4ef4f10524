"""Refused connections and messages: counted by reason, logged with who it was, within a limit."""

import structlog

from denseface.service.monitoring.figures import Counters

__all__ = ["Rejections"]

_OF_STRANGERS = ("unknown key", "revoked key", "handshake")
"""Reasons whose keys are not in the allow-list: there are as many of them as somebody likes."""


class Rejections:
    """Counts under the name `refused`, with the reason as label."""

    def __init__(self, counters: Counters) -> None:
        self._counters = counters
        self._log = structlog.get_logger("hub")

    def counts(self) -> dict[str, int]:
        """Give the number of rejections by reason."""
        return self._counters.by_label("refused")

    def note(self, reason: str, **who: object) -> None:
        """Count a rejection and log it, unless there are too many of its reason and its key.

        `reason` is one of a fixed set, `who` names the key, the address and what else is known.
        """
        self._counters.add("refused", reason)
        whose = "" if reason in _OF_STRANGERS else str(who.get("key") or "")
        self._log.warning("refused", per=("refused", reason, whose), reason=reason, **who)
