"""Every message between the processes: who may say what to whom.

Each class is the JSON header of one kind of message; how it is written is in
`service.protocol.wire`.
"""

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from denseface.recon.settings import Settings
from denseface.service.protocol.message_base import (
    BaseAnswer,
    BaseMessage,
    BaseRequest,
    CaptureId,
    Digest,
    Moment,
    Name,
    Number,
    PeerName,
    Seconds,
    Text,
    Token,
)
from denseface.service.protocol.operator_messages import (
    DeadLetter,
    DeadLetters,
    DropDead,
    ListDead,
    Purge,
    Removed,
    RetryDead,
)
from denseface.service.protocol.payload import FaceHeader, FrameHeader, PreviewHeader
from denseface.service.protocol.status import Latency, Status

__all__ = [
    "Announce", "CaptureFailed", "CaptureId", "CapturePending", "CaptureUnknown", "DeadLetter",
    "DeadLetters", "Denied", "DropDead", "FaceDone", "FindStart", "Frame", "FrameAccepted",
    "FrameFailed", "FrameRefused", "FromHub", "GetFace", "GetNext", "GetStatus", "Goodbye",
    "Heartbeat", "Job", "JobFailed", "Latency", "ListDead", "Message", "NothingNewer", "Press",
    "PressAccepted", "PressReason", "PressRefused", "Preview", "PreviewFrame", "Purge", "Removed",
    "Request", "RequestFailed", "Result", "RetryDead", "SensorReady", "StartAt", "Status", "Take",
    "TakePreview", "ToHub", "WorkerReady",
]


PressReason = Literal[
    "no_sensor", "sensor", "sensor_gone", "timeout", "queue", "disk", "purged"]
"""Why there is no capture: also what the metrics count by."""


class _WithFrame(BaseMessage):
    frame: FrameHeader

    @property
    def payload(self) -> FrameHeader:
        return self.frame


class _WithFace(BaseMessage):
    face: FaceHeader

    @property
    def payload(self) -> FaceHeader:
        return self.face


class _WithPreview(BaseMessage):
    preview: PreviewHeader

    @property
    def payload(self) -> PreviewHeader:
        return self.preview


# --- client to hub

class Press(BaseRequest):
    """Take a frame now and make a face of it; the same id again is the same capture."""

    kind: Literal["press"] = "press"
    capture_id: CaptureId


class GetFace(BaseRequest):
    """Give the outcome of a capture; wait for it up to `wait_s`."""

    kind: Literal["get_face"] = "get_face"
    capture_id: CaptureId
    wait_s: Seconds = 0


class GetNext(BaseRequest):
    """Give the first publication after a sequence number."""

    kind: Literal["get_next"] = "get_next"
    after: Number


class FindStart(BaseRequest):
    """Say after which number to start, to be given what is asked for here."""

    kind: Literal["find_start"] = "find_start"
    last: Annotated[int, Field(ge=1, lt=2**31)] | None = None
    """The last so many outcomes that are kept."""
    since: Moment | None = None
    """Outcomes of this time or later."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.last is None) == (self.since is None):
            raise ValueError("expected either last or since")
        return self


class GetStatus(BaseRequest):
    """Say who is there and what was done."""

    kind: Literal["get_status"] = "get_status"


# --- hub to client

class PressAccepted(BaseAnswer):
    """The frame is safe on the hub's disk: it will end as a face or as a named failure."""

    kind: Literal["press_accepted"] = "press_accepted"
    capture_id: CaptureId


class PressRefused(BaseAnswer):
    """There is no such capture and none will appear."""

    kind: Literal["press_refused"] = "press_refused"
    capture_id: CaptureId
    reason: PressReason
    message: Text


class CapturePending(BaseAnswer):
    """Accepted and not finished."""

    kind: Literal["capture_pending"] = "capture_pending"
    capture_id: CaptureId


class CaptureUnknown(BaseAnswer):
    """Never accepted, or no longer kept."""

    kind: Literal["capture_unknown"] = "capture_unknown"
    capture_id: CaptureId


class RequestFailed(BaseAnswer):
    """The hub could not answer."""

    kind: Literal["request_failed"] = "request_failed"
    message: Text


class NothingNewer(BaseAnswer):
    """No publication after the one asked for."""

    kind: Literal["nothing_newer"] = "nothing_newer"
    epoch: Token
    sequence: Number


class StartAt(BaseAnswer):
    """The answer to `FindStart`."""

    kind: Literal["start_at"] = "start_at"
    epoch: Token
    sequence: Number
    """What is asked for comes after this number."""


class _Outcome(BaseAnswer):
    epoch: Token
    """The store that counts `sequence`; another one after the data folder was replaced."""
    sequence: Number
    """Number of this outcome; one that is missing was removed or withdrawn."""
    capture_id: CaptureId


class FaceDone(_Outcome, _WithFace):
    """A finished face: published on topic `faces`, and the answer to `GetFace`, `GetNext`."""

    kind: Literal["face_done"] = "face_done"


class CaptureFailed(_Outcome):
    """A capture that ended without a face: published like a face."""

    kind: Literal["capture_failed"] = "capture_failed"
    error: Name
    message: Text
    dead: bool
    """Given up after repeated attempts, with the frame kept."""


class Preview(_WithPreview):
    """What the sensor sees: published on topic `preview` and not kept."""

    kind: Literal["preview"] = "preview"
    epoch: Token
    """The hub's process that counts `sequence`."""
    sequence: Number
    """A number that is missing was not delivered, and cannot be asked for."""


# --- sensor and worker to hub

class SensorReady(BaseMessage):
    """A capture process has its source open."""

    kind: Literal["sensor_ready"] = "sensor_ready"
    name: PeerName
    source: Text


class WorkerReady(BaseMessage):
    """A worker is free for one job."""

    kind: Literal["worker_ready"] = "worker_ready"
    name: PeerName
    credit: Number
    """One more each time; a repeat of the same one asks for nothing new."""


class Heartbeat(BaseMessage):
    """A sensor or worker is alive."""

    kind: Literal["heartbeat"] = "heartbeat"
    holding: CaptureId | None = None
    """The job that a worker holds."""


class Goodbye(BaseMessage):
    """A sensor or worker leaves in order; a job that it did not answer is handed back."""

    kind: Literal["goodbye"] = "goodbye"


class Frame(_WithFrame):
    """The frame that was asked for."""

    kind: Literal["frame"] = "frame"
    capture_id: CaptureId


class FrameFailed(BaseMessage):
    """The sensor has no frame to give."""

    kind: Literal["frame_failed"] = "frame_failed"
    capture_id: CaptureId
    message: Text


class PreviewFrame(_WithPreview):
    """The preview that was asked for."""

    kind: Literal["preview_frame"] = "preview_frame"


class Result(_WithFace):
    """A worker's face."""

    kind: Literal["result"] = "result"
    capture_id: CaptureId
    settings_hash: Token
    frame_sha256: Digest
    """As in the job: another frame may have come under this id meanwhile."""


class JobFailed(BaseMessage):
    """A worker could not make a face."""

    kind: Literal["job_failed"] = "job_failed"
    capture_id: CaptureId
    settings_hash: Token
    frame_sha256: Digest
    """As in the job: another frame may have come under this id meanwhile."""
    error: Name
    message: Text
    final: bool
    """True where another attempt would end the same: there is no face in the frame."""


# --- hub to sensor and worker

class Announce(BaseMessage):
    """The hub does not know you: say that you are ready."""

    kind: Literal["announce"] = "announce"


class Denied(BaseMessage):
    """Your key has not the role for what you said."""

    kind: Literal["denied"] = "denied"
    message: Text


class Take(BaseMessage):
    """Send the newest frame as this capture."""

    kind: Literal["take"] = "take"
    capture_id: CaptureId


class TakePreview(BaseMessage):
    """Send a preview of what you see, when no frame is to be taken; once."""

    kind: Literal["take_preview"] = "take_preview"


class FrameAccepted(BaseMessage):
    """The frame is safe: forget it."""

    kind: Literal["frame_accepted"] = "frame_accepted"
    capture_id: CaptureId


class FrameRefused(BaseMessage):
    """Nobody waits for this frame, or it cannot be kept: forget it."""

    kind: Literal["frame_refused"] = "frame_refused"
    capture_id: CaptureId
    message: Text


class Job(_WithFrame):
    """Make a face of this frame."""

    kind: Literal["job"] = "job"
    capture_id: CaptureId
    attempt: Number
    settings: Settings
    settings_hash: Token
    frame_sha256: Digest
    """Of the frame as the hub keeps it."""


Request = (Press | GetFace | GetNext | FindStart | GetStatus | ListDead | RetryDead | DropDead
           | Purge)
ToHub = (Press | GetFace | GetNext | FindStart | GetStatus | ListDead | RetryDead | DropDead
         | Purge | SensorReady | WorkerReady | Heartbeat | Goodbye | Frame | FrameFailed
         | PreviewFrame | Result | JobFailed)
FromHub = (PressAccepted | PressRefused | CapturePending | CaptureUnknown | RequestFailed
           | NothingNewer | StartAt | DeadLetters | Removed | FaceDone | CaptureFailed | Status
           | Preview | Announce | Denied | Take | TakePreview | FrameAccepted | FrameRefused | Job)
Message = ToHub | FromHub
