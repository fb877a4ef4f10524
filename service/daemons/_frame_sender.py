"""Frames on their way to the hub: sent again until the hub has them, or wants them no more."""

import time
from dataclasses import dataclass

import structlog

from denseface.capture import RgbdFrame
from denseface.service.protocol import messages
from denseface.service.protocol.payload import FrameHeader
from denseface.service.runtime.failpoints import failpoint
from denseface.service.transport.hub_connection import HubConnection

_MAX_RESEND_S = 30.0
"""Longest pause before a frame that is not acknowledged is sent again, seconds."""
_log = structlog.get_logger("capture")


@dataclass
class _UnacknowledgedFrame:
    """A frame that is sent again and again until the hub answers."""

    frame: RgbdFrame
    pause_s: float
    """From the last time it was sent until `due`."""
    due: float = 0.0
    """When to send it again, by the monotonic clock, seconds."""


class FrameSender:
    """Sends frames again, at growing intervals, that the hub has neither accepted nor refused."""

    def __init__(self, connection: HubConnection, resend_s: float) -> None:
        self._connection = connection
        self._resend_s = resend_s
        self._frames: dict[str, _UnacknowledgedFrame] = {}
        """By capture."""

    def __contains__(self, capture_id: str) -> bool:
        return capture_id in self._frames

    def __len__(self) -> int:
        return len(self._frames)

    def send(self, capture_id: str, frame: RgbdFrame) -> None:
        """Send a frame, and keep it until `answered`."""
        self._frames[capture_id] = _UnacknowledgedFrame(frame, self._resend_s)
        self.send_again(capture_id)

    def send_again(self, capture_id: str) -> None:
        """Send a frame once more that is not answered yet."""
        sent = self._frames[capture_id]
        sent.due = time.monotonic() + sent.pause_s
        header, arrays = FrameHeader.of(sent.frame)
        self._connection.send(messages.Frame(capture_id=capture_id, frame=header), arrays)
        failpoint("capture.frame.sent")

    def answered(self, capture_id: str) -> None:
        """Forget a frame: the hub has it, or wants it no more."""
        self._frames.pop(capture_id, None)

    def send_due(self) -> None:
        """Send again what got no answer for long enough."""
        now = time.monotonic()
        for capture_id, sent in self._frames.items():
            if now >= sent.due:
                sent.pause_s = min(2 * sent.pause_s, _MAX_RESEND_S)
                _log.warning("frame not acknowledged, sent again", capture_id=capture_id,
                             next_in_s=sent.pause_s)
                self.send_again(capture_id)
