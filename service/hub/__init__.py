"""What the hub decides: messages and the time in, messages out; no sockets, clock or disk."""

from denseface.service.hub.hub import Hub
from denseface.service.hub.presses import settings_hash

__all__ = ["Hub", "settings_hash"]
