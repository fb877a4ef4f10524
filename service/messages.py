"""Every message between the processes: who may say what to whom.

Each class is the JSON header of one kind of message; how it is written is in `service.wire`.
"""

from typing import Annotated, Literal, Self

from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, model_validator

from recon.settings import Settings
from service.payload import FaceHeader, FrameHeader, Payload

__all__ = [
    "Announce", "CaptureFailed", "CaptureId", "CapturePending", "CaptureUnknown", "DeadLetter",
    "DeadLetters", "DropDead", "FaceDone", "FindStart", "Frame", "FrameAccepted", "FrameFailed",
    "FrameRefused", "FromHub", "GetFace", "GetNext", "GetStatus", "Goodbye", "Heartbeat", "Job",
    "JobFailed", "ListDead", "Message", "NothingNewer", "Press", "PressAccepted", "PressRefused",
    "Purge", "Removed", "Request", "RequestFailed", "Result", "RetryDead", "SensorReady",
    "StartAt", "Status", "Take", "ToHub", "WorkerReady",
]

CaptureId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
"""Chosen by whoever pressed; also part of file names, hence no dots and no slashes."""

_Name = Annotated[str, Field(max_length=200)]
_Text = Annotated[str, Field(max_length=4000)]
_Token = Annotated[str, Field(pattern=r"^[0-9a-f]{1,64}$")]
_Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
_Number = Annotated[int, Field(ge=0, lt=2**63)]
_Seconds = Annotated[float, Field(ge=0, le=3600)]


class _Message(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    version: Literal[1] = 1

    @property
    def payload(self) -> Payload | None:
        """What says which arrays follow this header."""
        return None


class _WithFrame(_Message):
    frame: FrameHeader

    @property
    def payload(self) -> FrameHeader:
        return self.frame


class _WithFace(_Message):
    face: FaceHeader

    @property
    def payload(self) -> FaceHeader:
        return self.face


class _Request(_Message):
    request: _Number
    """Chosen by the client, repeated in the answer."""


class _Answer(_Message):
    request: _Number = 0
    """The request answered; 0 where nobody asked: a publication."""


# --- client to hub

class Press(_Request):
    """Take a frame now and make a face of it; the same id again is the same capture."""

    kind: Literal["press"] = "press"
    capture_id: CaptureId


class GetFace(_Request):
    """Give the outcome of a capture; wait for it up to `wait_s`."""

    kind: Literal["get_face"] = "get_face"
    capture_id: CaptureId
    wait_s: _Seconds = 0


class GetNext(_Request):
    """Give the first publication after a sequence number."""

    kind: Literal["get_next"] = "get_next"
    after: _Number


class FindStart(_Request):
    """Say after which number to start, to be given what is asked for here."""

    kind: Literal["find_start"] = "find_start"
    last: Annotated[int, Field(ge=1, lt=2**31)] | None = None
    """The last so many outcomes that are kept."""
    since: AwareDatetime | None = None
    """Outcomes of this time or later."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.last is None) == (self.since is None):
            raise ValueError("expected either last or since")
        return self


class GetStatus(_Request):
    """Say who is there and what was done."""

    kind: Literal["get_status"] = "get_status"


class ListDead(_Request):
    """Operator: give the next captures that were given up, by sequence number."""

    kind: Literal["list_dead"] = "list_dead"
    after: _Number = 0


class RetryDead(_Request):
    """Operator: try a capture again that was given up, with all its attempts."""

    kind: Literal["retry_dead"] = "retry_dead"
    capture_id: CaptureId


class DropDead(_Request):
    """Operator: remove a capture that was given up."""

    kind: Literal["drop_dead"] = "drop_dead"
    capture_id: CaptureId


class Purge(_Request):
    """Operator: remove captures, whatever became of them; repeat while some are left."""

    kind: Literal["purge"] = "purge"
    capture_id: CaptureId | None = None
    before: AwareDatetime | None = None
    """What was accepted before this time."""
    everything: bool = False
    """Also all that is in quarantine."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.capture_id is not None) + (self.before is not None) + self.everything != 1:
            raise ValueError("expected one of capture_id, before and everything")
        return self


# --- hub to client

class PressAccepted(_Answer):
    """The frame is safe on the hub's disk: it will end as a face or as a named failure."""

    kind: Literal["press_accepted"] = "press_accepted"
    capture_id: CaptureId


class PressRefused(_Answer):
    """There is no such capture and none will appear."""

    kind: Literal["press_refused"] = "press_refused"
    capture_id: CaptureId
    message: _Text


class CapturePending(_Answer):
    """Accepted and not finished."""

    kind: Literal["capture_pending"] = "capture_pending"
    capture_id: CaptureId


class CaptureUnknown(_Answer):
    """Never accepted, or no longer kept."""

    kind: Literal["capture_unknown"] = "capture_unknown"
    capture_id: CaptureId


class RequestFailed(_Answer):
    """The hub could not answer."""

    kind: Literal["request_failed"] = "request_failed"
    message: _Text


class NothingNewer(_Answer):
    """No publication after the one asked for."""

    kind: Literal["nothing_newer"] = "nothing_newer"
    epoch: _Token
    sequence: _Number


class StartAt(_Answer):
    """The answer to `FindStart`."""

    kind: Literal["start_at"] = "start_at"
    epoch: _Token
    sequence: _Number
    """What is asked for comes after this number."""


class DeadLetter(BaseModel):
    """A capture that was given up; its frame is kept."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    sequence: _Number
    capture_id: CaptureId
    error: _Name
    message: Annotated[str, Field(max_length=300)]
    """The beginning of it."""
    attempts: _Number
    accepted_at: _Name
    """UTC, ISO 8601."""
    finished_at: _Name


class DeadLetters(_Answer):
    """The answer to `ListDead`."""

    kind: Literal["dead_letters"] = "dead_letters"
    letters: Annotated[tuple[DeadLetter, ...], Field(max_length=50)]
    """None where there are no more."""


class Removed(_Answer):
    """The answer to `DropDead` and `Purge`."""

    kind: Literal["removed"] = "removed"
    removed: _Number
    """Captures removed now."""
    left: bool
    """There are more that were asked for."""


class _Outcome(_Answer):
    epoch: _Token
    """The store that counts `sequence`; another one after the data folder was replaced."""
    sequence: _Number
    """Number of this outcome; one that is missing was removed or withdrawn."""
    capture_id: CaptureId


class FaceDone(_Outcome, _WithFace):
    """A finished face: published on topic `faces`, and the answer to `GetFace`, `GetNext`."""

    kind: Literal["face_done"] = "face_done"


class CaptureFailed(_Outcome):
    """A capture that ended without a face: published like a face."""

    kind: Literal["capture_failed"] = "capture_failed"
    error: _Name
    message: _Text
    dead: bool
    """Given up after repeated attempts, with the frame kept."""


class Status(_Answer):
    """Published on topic `status` at every heartbeat."""

    kind: Literal["status"] = "status"
    epoch: _Token
    sequence: _Number
    """Of the last outcome."""
    hub_version: _Name
    sensors: tuple[_Name, ...]
    workers: tuple[_Name, ...]
    pressed: _Number
    """Presses that wait for their frame."""
    queued: _Number
    working: _Number
    done: _Number
    failed: _Number
    dead: _Number

    @property
    def ready(self) -> bool:
        """A press now would become a face."""
        return bool(self.sensors) and bool(self.workers)


# --- sensor and worker to hub

class SensorReady(_Message):
    """A capture process has its source open."""

    kind: Literal["sensor_ready"] = "sensor_ready"
    name: _Name
    source: _Text


class WorkerReady(_Message):
    """A worker is free for one job."""

    kind: Literal["worker_ready"] = "worker_ready"
    name: _Name
    credit: _Number
    """One more each time; a repeat of the same one asks for nothing new."""


class Heartbeat(_Message):
    """A sensor or worker is alive."""

    kind: Literal["heartbeat"] = "heartbeat"
    holding: CaptureId | None = None
    """The job that a worker holds."""


class Goodbye(_Message):
    """A sensor or worker leaves in order, holding nothing."""

    kind: Literal["goodbye"] = "goodbye"


class Frame(_WithFrame):
    """The frame that was asked for."""

    kind: Literal["frame"] = "frame"
    capture_id: CaptureId


class FrameFailed(_Message):
    """The sensor has no frame to give."""

    kind: Literal["frame_failed"] = "frame_failed"
    capture_id: CaptureId
    message: _Text


class Result(_WithFace):
    """A worker's face."""

    kind: Literal["result"] = "result"
    capture_id: CaptureId
    settings_hash: _Token
    frame_sha256: _Digest
    """As in the job: another frame may have come under this id meanwhile."""


class JobFailed(_Message):
    """A worker could not make a face."""

    kind: Literal["job_failed"] = "job_failed"
    capture_id: CaptureId
    settings_hash: _Token
    frame_sha256: _Digest
    """As in the job: another frame may have come under this id meanwhile."""
    error: _Name
    message: _Text
    final: bool
    """True where another attempt would end the same: there is no face in the frame."""


# --- hub to sensor and worker

class Announce(_Message):
    """The hub does not know you: say that you are ready."""

    kind: Literal["announce"] = "announce"


class Take(_Message):
    """Send the newest frame as this capture."""

    kind: Literal["take"] = "take"
    capture_id: CaptureId


class FrameAccepted(_Message):
    """The frame is safe: forget it."""

    kind: Literal["frame_accepted"] = "frame_accepted"
    capture_id: CaptureId


class FrameRefused(_Message):
    """Nobody waits for this frame, or it cannot be kept: forget it."""

    kind: Literal["frame_refused"] = "frame_refused"
    capture_id: CaptureId
    message: _Text


class Job(_WithFrame):
    """Make a face of this frame."""

    kind: Literal["job"] = "job"
    capture_id: CaptureId
    attempt: _Number
    settings: Settings
    settings_hash: _Token
    frame_sha256: _Digest
    """Of the frame as the hub keeps it."""


Request = (Press | GetFace | GetNext | FindStart | GetStatus | ListDead | RetryDead | DropDead
           | Purge)
ToHub = (Press | GetFace | GetNext | FindStart | GetStatus | ListDead | RetryDead | DropDead
         | Purge | SensorReady | WorkerReady | Heartbeat | Goodbye | Frame | FrameFailed | Result
         | JobFailed)
FromHub = (PressAccepted | PressRefused | CapturePending | CaptureUnknown | RequestFailed
           | NothingNewer | StartAt | DeadLetters | Removed | FaceDone | CaptureFailed | Status
           | Announce | Take | FrameAccepted | FrameRefused | Job)
Message = ToHub | FromHub
