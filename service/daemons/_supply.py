"""What gives frames to the capture process: a live sensor or a recording, asked alike.

Nothing here waits: what is asked for comes out of `step`, some time after `wake` became readable.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol

from denseface.capture import RgbdFrame
from denseface.service.gate.live import Hinted
from denseface.service.protocol import messages
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.sensor_messages import LiveStateName, SensorFigures
from denseface.service.runtime.wake_pipe import WakePipe

__all__ = ["Hinted", "NotTaken", "Outcome", "Picture", "Supply", "SupplyState", "Taken"]


@dataclass(frozen=True)
class Taken:
    """The frame of a press."""

    capture_id: str
    frame: RgbdFrame


@dataclass(frozen=True)
class NotTaken:
    """A press that gets no frame."""

    capture_id: str
    reason: str
    hint: Hint | None = None
    """Of the last frame, where frames came and the press's gate let none through."""


@dataclass(frozen=True)
class Picture:
    """The frame of a preview."""

    frame: RgbdFrame
    hint: Hint | None = None
    """Of this frame, where it was judged."""


Outcome = Taken | NotTaken | Picture | Hinted


@dataclass(frozen=True)
class SupplyState:
    """How a source is, as the hub is told."""

    state: LiveStateName
    reason: str = ""
    identity: str = ""
    figures: SensorFigures = field(default_factory=SensorFigures)


class Supply(Protocol):
    """Gives frames of one source."""

    wake: WakePipe
    """Readable when `step` may have something new to give."""

    @property
    def state(self) -> SupplyState:
        """How the source is."""

    def press(self, take: messages.Take) -> None:
        """Ask for a frame; a repeat of what is asked for already changes nothing."""

    def preview(self) -> None:
        """Ask for a picture: one, however often it is asked for."""

    def send_hints(self, seconds: float) -> None:
        """Ask for hints from now on, for so long."""

    def step(self, *, busy: bool) -> Iterator[Outcome]:
        """Give what became of what was asked for; no pictures while `busy`.

        Raises
        ------
        CaptureError
            The source cannot be opened, or has gone for good.
        """

    def hangs(self) -> str:
        """Say why the process is to be ended, as when the driver hangs; empty where it is not."""

    def close(self) -> bool:
        """Close the source; False where the driver hangs."""
