"""What the hub decides: messages and the time in, messages out; no sockets, clock or disk."""

from denseface.service.hub.hub import Hub
from denseface.service.hub.presses import settings_hash
from denseface.service.hub.previews import PREVIEW_PERIOD_S

__all__ = ["PREVIEW_PERIOD_S", "Hub", "settings_hash"]
