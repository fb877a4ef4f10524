"""What passes between the hub and the capture processes; part of `service.protocol.messages`."""

from typing import Annotated, ClassVar, Literal

from pydantic import BaseModel, ConfigDict, Field

from denseface.capture import MAX_BURST
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.message_base import (
    CaptureId,
    FromHub,
    Number,
    PeerName,
    Text,
    ToHub,
)
from denseface.service.protocol.payload import FrameHeader, PreviewHeader

DEFAULT_GATE_S = 10.0
"""How long a gated press waits for a frame that is good enough, unless it says so, seconds."""
Gate = Literal["off", "wait", "refuse", "best"]
"""Whether the frame has to be good enough: no; wait for one that is; refuse the press if not; take
the best one of a while, whatever is wrong with it."""
GateSeconds = Annotated[float, Field(ge=0, le=120)]
"""How long a press with the gate `wait` or `best` waits for a good frame."""
BurstFrames = Annotated[int, Field(ge=1, le=MAX_BURST)]
"""How many consecutive frames are made into one."""
LiveStateName = Literal[
    "absent", "opening", "warming", "streaming", "stalled", "blocked", "closing"]
"""Where a source stands; a label of the metric of sensors."""


# --- sensor to hub

class SensorFigures(BaseModel):
    """What a capture process has counted since it began."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    frames: Number = 0
    """Pairs of depth and colour."""
    drops: Number = 0
    """Images that were lost, or had no partner."""
    skew_us: Number = 0
    """Between depth and colour of the newest pair, without its sign, microseconds."""
    stalls: Number = 0
    """Times that the stream fell silent."""
    reconnects: Number = 0
    """Times that the sensor was opened again."""
    wrong_size: Number = 0
    """Images of another size than the mode's."""


class SensorReady(ToHub):
    """A capture process has its source open; see also `SensorState`."""

    kind: Literal["sensor_ready"] = "sensor_ready"
    name: PeerName
    source: Text


class SensorState(ToHub):
    """How a source is: sent at each change, and with heartbeats, at most once a second."""

    kind: Literal["sensor_state"] = "sensor_state"
    name: PeerName
    state: LiveStateName
    reason: Annotated[str, Field(max_length=500)] = ""
    """Why it does not stream, for whoever presses."""
    identity: Annotated[str, Field(max_length=200)] = ""
    """Serial number, USB port or address of the sensor; empty where it is not known."""
    figures: SensorFigures = SensorFigures()


class QualityHint(ToHub):
    """The quality of a frame, about ten times a second while hints are asked for."""

    kind: Literal["quality_hint"] = "quality_hint"
    hint: Hint


class Frame(ToHub):
    """The frame that was asked for."""

    frame: FrameHeader
    kind: Literal["frame"] = "frame"
    capture_id: CaptureId


class FrameFailed(ToHub):
    """The sensor has no frame to give."""

    newer: ClassVar = frozenset({"reason", "hint"})

    kind: Literal["frame_failed"] = "frame_failed"
    capture_id: CaptureId
    message: Text
    reason: Literal["sensor", "quality"] = "sensor"
    """`quality` where frames came and none was good enough for the press's gate."""
    hint: Hint | None = None
    """Of the last of these frames."""


class PreviewFrame(ToHub):
    """The preview that was asked for."""

    preview: PreviewHeader
    kind: Literal["preview_frame"] = "preview_frame"


# --- hub to sensor

class Take(FromHub):
    """Send the first frame that was exposed after this message came, as this capture."""

    newer: ClassVar = frozenset({"gate", "gate_timeout", "frames"})

    kind: Literal["take"] = "take"
    capture_id: CaptureId
    gate: Gate = "off"
    gate_timeout: GateSeconds = DEFAULT_GATE_S
    frames: BurstFrames = 1


class TakePreview(FromHub):
    """Send one preview, of a picture that is newer than the last one sent."""

    kind: Literal["take_preview"] = "take_preview"


class TakeHints(FromHub):
    """Send hints from now on, for so long; repeated while anybody wants them."""

    kind: Literal["take_hints"] = "take_hints"
    seconds: Annotated[float, Field(gt=0, le=3600)]


class Restart(FromHub):
    """End and begin anew, or open the source again where nobody would start the process."""

    kind: Literal["restart"] = "restart"


class FrameAccepted(FromHub):
    """The frame is safe: the sensor may forget it."""

    kind: Literal["frame_accepted"] = "frame_accepted"
    capture_id: CaptureId


class FrameRefused(FromHub):
    """Nobody waits for this frame, or it cannot be saved: the sensor may forget it."""

    kind: Literal["frame_refused"] = "frame_refused"
    capture_id: CaptureId
    message: Text
