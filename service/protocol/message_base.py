"""What the messages of `service.protocol.messages` are made of."""

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, FailFast, Field

from denseface.recon.face import Consent
from denseface.service.protocol.payload import Payload
from denseface.validation import CAPTURE_ID, PEER_NAME

CaptureId = Annotated[str, Field(pattern=CAPTURE_ID)]
"""Chosen by whoever pressed; also part of file names, hence no dots and no slashes."""

Name = Annotated[str, Field(max_length=200)]
"""Of an error, a sensor or a stage; also a time where it is only shown."""
PeerName = Annotated[str, Field(pattern=PEER_NAME)]
"""Of a sensor or worker: a machine's name and a process's number."""
Names = Annotated[tuple[Name, ...], FailFast()]
"""Validation stops at the first error: each of 100,000 would cost a thousand bytes of memory."""
Text = Annotated[str, Field(max_length=4000)]
"""Of a person or an error message."""
Token = Annotated[str, Field(pattern=r"^[0-9a-f]{1,64}$")]
"""Hexadecimal name of settings or of a store."""
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
"""SHA-256, hexadecimal."""
Number = Annotated[int, Field(ge=0, lt=2**63)]
"""A count or a number in a sequence; SQLite and other languages have it in 64 bits."""
Seconds = Annotated[float, Field(ge=0, le=3600)]
"""How long a request may wait."""
VERSION: Literal[2] = 2
"""Of the messages; a message of another one is refused."""
MAX_JOBS = 2
"""Jobs that a worker has at once: the one under way and the one that follows it."""


def _utc(moment: datetime) -> datetime:
    try:
        return moment.astimezone(UTC)
    except OverflowError as error:
        raise ValueError("this time does not exist in UTC") from error


Moment = Annotated[AwareDatetime, AfterValidator(_utc)]
"""A time with a zone, kept in UTC."""


class BaseMessage(BaseModel):
    """What all messages have in common."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    newer: ClassVar[frozenset[str]] = frozenset()
    """Fields that an older release refuses: not written where they say what they did not yet."""

    version: Literal[2] = VERSION
    if TYPE_CHECKING:  # a field of each kind, behind those that it inherits
        kind: str

    @property
    def payload(self) -> Payload | None:
        """The part of this header that describes the arrays behind it."""
        return next((one for _, one in self if isinstance(one, Payload)), None)


class ToHub(BaseMessage):
    """A message that the hub receives."""


class FromHub(BaseMessage):
    """A message that the hub sends."""


class BaseRequest(ToHub):
    """A client's request."""

    request: Number
    """Chosen by the client, repeated in the answer."""


class BaseAnswer(FromHub):
    """The hub's answer."""

    request: Number = 0
    """The request answered; 0 where nobody asked: a publication."""


class CaptureSummary(BaseModel):
    """What a row says of a capture; its face, or its frame, says the rest."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    capture_id: CaptureId
    state: Name
    """A `CaptureState`."""
    accepted_at: Name
    """UTC, ISO 8601, as are all times here."""
    attempts: Number
    finished_at: Name | None = None
    """None where it has no outcome; so is what follows."""
    sequence: Number | None = None
    error: Name | None = None
    """None where there is a face."""
    message: Annotated[str, Field(max_length=300)] | None = None
    """Its first characters."""
    consent: Consent | None = None


class DeadLetter(BaseModel):
    """A capture that was given up; its frame is kept."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    sequence: Number
    capture_id: CaptureId
    error: Name
    message: Annotated[str, Field(max_length=300)]
    """Its first characters."""
    attempts: Number
    accepted_at: Name
    """UTC, ISO 8601."""
    finished_at: Name
