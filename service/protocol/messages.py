"""Every message between the processes: who may say what to whom.

Each class is the JSON header of one kind of message; how it is written is in
`service.protocol.wire`. A new kind is a class here and a row of `TO_HUB` or `FROM_HUB`; what comes
of it is a case of `Hub.receive`, and `docs/wire.md` says what it is for.
"""

from typing import Annotated, ClassVar, Literal, Self

from pydantic import FailFast, Field, model_validator

from denseface.recon.face import Consent as Consent
from denseface.recon.settings import Settings
from denseface.service.protocol.frame_messages import FrameKept as FrameKept
from denseface.service.protocol.frame_messages import GetFrame as GetFrame
from denseface.service.protocol.hint import Hint as Hint
from denseface.service.protocol.message_base import (
    BaseAnswer,
    BaseMessage,
    BaseRequest,
    CaptureId,
    CaptureSummary,
    DeadLetter,
    Digest,
    FromHub,
    Moment,
    Name,
    Number,
    PeerName,
    Seconds,
    Text,
    ToHub,
    Token,
)
from denseface.service.protocol.payload import FaceHeader, FrameHeader, PreviewHeader
from denseface.service.protocol.roles import Role
from denseface.service.protocol.sensor_messages import (
    DEFAULT_GATE_S,
    BurstFrames,
    Gate,
    GateSeconds,
)
from denseface.service.protocol.sensor_messages import Frame as Frame
from denseface.service.protocol.sensor_messages import FrameAccepted as FrameAccepted
from denseface.service.protocol.sensor_messages import FrameFailed as FrameFailed
from denseface.service.protocol.sensor_messages import FrameRefused as FrameRefused
from denseface.service.protocol.sensor_messages import PreviewFrame as PreviewFrame
from denseface.service.protocol.sensor_messages import QualityHint as QualityHint
from denseface.service.protocol.sensor_messages import Restart as Restart
from denseface.service.protocol.sensor_messages import SensorReady as SensorReady
from denseface.service.protocol.sensor_messages import SensorState as SensorState
from denseface.service.protocol.sensor_messages import Take as Take
from denseface.service.protocol.sensor_messages import TakeHints as TakeHints
from denseface.service.protocol.sensor_messages import TakePreview as TakePreview
from denseface.service.protocol.status import Compiling as Compiling
from denseface.service.protocol.status import Latency as Latency
from denseface.service.protocol.status import Status as Status

PressReason = Literal[
    "no_sensor", "sensor", "sensor_gone", "quality", "timeout", "queue", "disk", "purged"]
"""Why there is no capture; a label of the metric of refused presses."""


class _WithFace(BaseMessage):
    face: FaceHeader


# --- client to hub

class Press(BaseRequest):
    """Take a frame now and make a face of it; the same id again is the same capture."""

    newer: ClassVar = frozenset({"sensor", "gate", "gate_timeout", "frames", "consent"})

    kind: Literal["press"] = "press"
    capture_id: CaptureId
    sensor: PeerName | None = None
    """The name of the sensor to ask; where None, the hub chooses one."""
    gate: Gate = "off"
    gate_timeout: GateSeconds = DEFAULT_GATE_S
    frames: BurstFrames = 1
    consent: Consent | None = None
    """Kept with the capture, and told with its face; a time that it promises is kept."""


class Withdraw(BaseRequest):
    """Remove what the same key pressed, wherever it stands; an operator, what anybody did."""

    kind: Literal["withdraw"] = "withdraw"
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
    """Give the sequence number after which the outcomes come that are asked for."""

    kind: Literal["find_start"] = "find_start"
    last: Annotated[int, Field(ge=1, lt=2**31)] | None = None
    """The last so many outcomes."""
    since: Moment | None = None
    """Outcomes of this time or later."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.last is None) == (self.since is None):
            raise ValueError("expected either last or since")
        return self


class GetStatus(BaseRequest):
    """Give the status."""

    kind: Literal["get_status"] = "get_status"


# --- hub to client

class PressAccepted(BaseAnswer):
    """The frame is safe on the hub's disk: it will end as a face or as a named failure."""

    kind: Literal["press_accepted"] = "press_accepted"
    capture_id: CaptureId


class PressRefused(BaseAnswer):
    """There is no such capture and none will appear."""

    newer: ClassVar = frozenset({"hint"})

    kind: Literal["press_refused"] = "press_refused"
    capture_id: CaptureId
    reason: PressReason
    message: Text
    hint: Hint | None = None
    """Of the last frame that was not good enough, where that is the reason."""


class CapturePending(BaseAnswer):
    """Accepted and not finished."""

    kind: Literal["capture_pending"] = "capture_pending"
    capture_id: CaptureId


class CaptureUnknown(BaseAnswer):
    """Never accepted, or no longer kept."""

    kind: Literal["capture_unknown"] = "capture_unknown"
    capture_id: CaptureId


class RequestFailed(BaseAnswer):
    """The hub could not answer, or the request is malformed; 0 where its number is unreadable."""

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
    """The number before the first outcome asked for."""


class _Outcome(BaseAnswer):
    epoch: Token
    """Names the store that numbers outcomes; another one after the data folder was replaced."""
    sequence: Number
    """Number of this outcome; a number that is missing was removed or withdrawn."""
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
    """Given up after repeated attempts; the frame is kept."""


class Preview(FromHub):
    """What the sensor sees: published on topic `preview` and not stored."""

    preview: PreviewHeader
    kind: Literal["preview"] = "preview"
    epoch: Token
    """Names the hub's process, which numbers previews."""
    sequence: Number
    """A number that is missing was not delivered and cannot be asked for."""


class Hints(FromHub):
    """What a person could do better: published on topic `hints` and not stored."""

    kind: Literal["hints"] = "hints"
    sensor: PeerName
    hint: Hint


# --- operator to hub, and the answers

class ListDead(BaseRequest):
    """Give the next captures that were given up, by sequence number."""

    kind: Literal["list_dead"] = "list_dead"
    after: Number = 0


class RetryDead(BaseRequest):
    """Try a capture again that was given up, with all its attempts."""

    kind: Literal["retry_dead"] = "retry_dead"
    capture_id: CaptureId


class DropDead(BaseRequest):
    """Remove a capture that was given up."""

    kind: Literal["drop_dead"] = "drop_dead"
    capture_id: CaptureId


class ListCaptures(BaseRequest):
    """Give the captures that were accepted last."""

    kind: Literal["list_captures"] = "list_captures"
    last: Annotated[int, Field(ge=1, le=50)] = 20


class RestartSensor(BaseRequest):
    """Have a capture process begin anew."""

    kind: Literal["restart_sensor"] = "restart_sensor"
    sensor: PeerName


class Purge(BaseRequest):
    """Remove captures, whatever became of them; repeat while some are left."""

    kind: Literal["purge"] = "purge"
    capture_id: CaptureId | None = None
    before: Moment | None = None
    """What was accepted before this time."""
    everything: bool = False
    """Also all that is in quarantine."""

    @model_validator(mode="after")
    def _one(self) -> Self:
        if (self.capture_id is not None) + (self.before is not None) + self.everything != 1:
            raise ValueError("expected one of capture_id, before and everything")
        return self


class DeadLetters(BaseAnswer):
    """The answer to `ListDead`."""

    kind: Literal["dead_letters"] = "dead_letters"
    letters: Annotated[tuple[DeadLetter, ...], Field(max_length=50), FailFast()]
    """None where there are no more."""


class CaptureList(BaseAnswer):
    """The answer to `ListCaptures`: the newest first, no frames and no faces."""

    kind: Literal["capture_list"] = "capture_list"
    captures: Annotated[tuple[CaptureSummary, ...], Field(max_length=50), FailFast()]


class SensorRestarting(BaseAnswer):
    """The answer to `RestartSensor`: the capture process was told to."""

    kind: Literal["sensor_restarting"] = "sensor_restarting"
    sensor: PeerName


class Removed(BaseAnswer):
    """The answer to `Withdraw`, `DropDead` and `Purge`: of these nothing is left."""

    kind: Literal["removed"] = "removed"
    removed: Number
    """Captures removed now."""
    left: bool
    """More are to be removed: repeat the request."""


# --- worker to hub; what sensors say is in `sensor_messages`

class WorkerReady(ToHub):
    """A worker is free for one job."""

    kind: Literal["worker_ready"] = "worker_ready"
    name: PeerName
    credit: Number
    """One more each time; a repeat of the same one asks for nothing new."""


class Heartbeat(ToHub):
    """A sensor or worker is alive."""

    newer: ClassVar = frozenset({"compiling"})

    kind: Literal["heartbeat"] = "heartbeat"
    holding: CaptureId | None = None
    """The job that a worker holds."""
    compiling: Compiling | None = None
    """Of a worker that is not ready yet."""


class Goodbye(ToHub):
    """A sensor or worker disconnects; a job that it did not answer is handed back."""

    kind: Literal["goodbye"] = "goodbye"


class Result(_WithFace, ToHub):
    """A worker's face."""

    kind: Literal["result"] = "result"
    capture_id: CaptureId
    settings_hash: Token
    frame_sha256: Digest
    """As in the job: another frame may have come under this id meanwhile."""


class JobFailed(ToHub):
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

class Announce(FromHub):
    """The hub does not know the peer, which is to say that it is ready."""

    kind: Literal["announce"] = "announce"


class Denied(FromHub):
    """The key has not the role for the message, or it is malformed; it was no request."""

    kind: Literal["denied"] = "denied"
    message: Text


class Job(FromHub):
    """Make a face of this frame."""

    frame: FrameHeader
    kind: Literal["job"] = "job"
    capture_id: CaptureId
    attempt: Number
    settings: Settings
    settings_hash: Token
    frame_sha256: Digest
    """Of the frame's file: the answer repeats it."""


TO_HUB: dict[type[ToHub], frozenset[Role]] = {
    Press: frozenset({Role.PRESSER}),
    Withdraw: frozenset({Role.PRESSER, Role.OPERATOR}),
    GetFace: frozenset({Role.SUBSCRIBER}),  # also a presser, for what it pressed itself
    GetFrame: frozenset({Role.OPERATOR}),  # so here
    GetNext: frozenset({Role.SUBSCRIBER}),
    FindStart: frozenset({Role.SUBSCRIBER}),
    GetStatus: frozenset(Role),
    ListCaptures: frozenset({Role.OPERATOR}),
    ListDead: frozenset({Role.OPERATOR}),
    RetryDead: frozenset({Role.OPERATOR}),
    DropDead: frozenset({Role.OPERATOR}),
    Purge: frozenset({Role.OPERATOR}),
    RestartSensor: frozenset({Role.OPERATOR}),
    SensorReady: frozenset({Role.SENSOR}),
    SensorState: frozenset({Role.SENSOR}),
    QualityHint: frozenset({Role.SENSOR}),
    WorkerReady: frozenset({Role.WORKER}),
    Heartbeat: frozenset({Role.SENSOR, Role.WORKER}),
    Goodbye: frozenset({Role.SENSOR, Role.WORKER}),
    Frame: frozenset({Role.SENSOR}),
    FrameFailed: frozenset({Role.SENSOR}),
    PreviewFrame: frozenset({Role.SENSOR}),
    Result: frozenset({Role.WORKER}),
    JobFailed: frozenset({Role.WORKER}),
}
"""Every message to the hub and the roles of which a key needs one to send it."""

FROM_HUB: tuple[type[FromHub], ...] = (
    PressAccepted, PressRefused, CapturePending, CaptureUnknown, RequestFailed, NothingNewer,
    StartAt, DeadLetters, CaptureList, SensorRestarting, Removed, FaceDone, CaptureFailed, Status,
    Preview, Hints, Announce, Denied, Take, TakePreview, TakeHints, FrameAccepted, FrameRefused,
    Restart, Job, FrameKept)
"""Every message that the hub sends."""
