"""Counts and times what goes into the hub and comes out of it.

The hub's state machine does not know: every stage of a capture shows in its messages.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from denseface.service.monitoring.figures import Figures
from denseface.service.protocol import messages
from denseface.service.protocol.outgoing import Output, Publish, Send
from denseface.service.protocol.wire import Packet
from denseface.service.runtime.bounded_dict import BoundedDict

__all__ = ["MessageWatch"]

_MAX_CAPTURES = 10_000
"""Captures, and refused presses, that are remembered; beyond it the oldest is forgotten."""


@dataclass
class _Times:
    """When a capture reached a stage, seconds of the hub's clock."""

    pressed: float | None = None
    accepted: float | None = None
    dispatched: float | None = None


class MessageWatch:
    """Counts what `service.monitoring.prometheus` names.

    Times are those of the hub's clock after it has handled a message.
    """

    def __init__(self, figures: Figures) -> None:
        self._counters = figures.counters
        self._latencies = figures.latencies
        self._captures: BoundedDict[str, _Times] = BoundedDict(_MAX_CAPTURES)
        self._refused: BoundedDict[tuple[bytes, str, int], None] = BoundedDict(_MAX_CAPTURES)
        """Peer, capture and request of presses that were refused: a repeat is refused again."""

    def record(self, now: float, packet: Packet | None, outputs: Sequence[Output]) -> None:
        """Record a message, None for a tick, and the outputs that it caused; `now` in seconds."""
        if packet and isinstance(packet.message, messages.Result | messages.JobFailed):
            self._ended(now, packet.message.capture_id)
        refused: dict[str, messages.PressRefused] = {}
        for output in outputs:
            message = output.packet.message
            match message:
                case messages.Take(capture_id=capture_id):
                    self._follow(capture_id).pressed = now
                case messages.PressRefused(capture_id=capture_id) if isinstance(output, Send):
                    press = output.peer, capture_id, message.request
                    if press not in self._refused:
                        refused[capture_id] = message
                        self._refused[press] = None
                case messages.FrameAccepted(capture_id=capture_id):
                    self._accepted(now, capture_id)
                case messages.Job(capture_id=capture_id, attempt=attempt):
                    self._dispatched(now, capture_id, attempt)
                case messages.FaceDone() | messages.CaptureFailed():
                    if isinstance(output, Publish):
                        self._published(now, message)
                    elif packet and isinstance(packet.message, messages.GetNext):
                        self._counters.add("fetched")
                case messages.Preview():
                    self._counters.add("previews")
                case messages.Hints():
                    self._counters.add("hints")
        for one in refused.values():  # one for each capture, however many pressed
            self._captures.pop(one.capture_id, None)
            self._counters.add("press_refused", one.reason)

    def _follow(self, capture_id: str) -> _Times:
        times = self._captures.pop(capture_id, None) or _Times()
        self._captures[capture_id] = times
        return times

    def _accepted(self, now: float, capture_id: str) -> None:
        times = self._captures.get(capture_id)
        if times is None or times.pressed is None or times.accepted is not None:
            return  # a repeat
        times.accepted = now
        self._counters.add("accepted")
        self._latencies.observe("press_to_accepted", now - times.pressed)

    def _dispatched(self, now: float, capture_id: str, attempt: int) -> None:
        times = self._follow(capture_id)
        times.dispatched = now
        if attempt > 1:
            self._counters.add("redelivered")
        elif times.accepted is not None:
            self._latencies.observe("accepted_to_dispatched", now - times.accepted)

    def _ended(self, now: float, capture_id: str) -> None:
        times = self._captures.get(capture_id)
        if times and times.dispatched is not None:
            self._latencies.observe("dispatched_to_result", now - times.dispatched)
            times.dispatched = None

    def _published(self, now: float, message: messages.FaceDone | messages.CaptureFailed) -> None:
        times = self._captures.pop(message.capture_id, None)
        if times and times.pressed is not None:
            self._latencies.observe("press_to_published", now - times.pressed)
        if isinstance(message, messages.CaptureFailed):
            self._counters.add("dead" if message.dead else "failed")
            return
        self._counters.add("done")
        for stage, taken_ms in message.face.report.timings_ms.items():
            self._latencies.observe(f"recon_{stage}", taken_ms / 1000)
