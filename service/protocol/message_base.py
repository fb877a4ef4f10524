"""What messages are made of."""

from datetime import UTC, datetime
from typing import TYPE_CHECKING, Annotated, Literal

from pydantic import AfterValidator, AwareDatetime, BaseModel, ConfigDict, FailFast, Field

from denseface.service.protocol.payload import Payload

__all__ = ["BaseAnswer", "BaseMessage", "BaseRequest", "CaptureId", "Digest", "FromHub", "Moment",
           "Name", "Names", "Number", "PeerName", "Seconds", "Text", "ToHub", "Token"]

CaptureId = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
"""Chosen by whoever pressed; also part of file names, hence no dots and no slashes."""

Name = Annotated[str, Field(max_length=200)]
PeerName = Annotated[str, Field(pattern=r"^[!-~]{1,100}$")]
"""Of a sensor or worker: a machine's name and a process's number."""
Names = Annotated[tuple[Name, ...], FailFast()]
"""One complaint is enough: each of a hundred thousand would cost a thousand bytes of memory."""
Text = Annotated[str, Field(max_length=4000)]
Token = Annotated[str, Field(pattern=r"^[0-9a-f]{1,64}$")]
Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
Number = Annotated[int, Field(ge=0, lt=2**63)]
Seconds = Annotated[float, Field(ge=0, le=3600)]


def _utc(moment: datetime) -> datetime:
    try:
        return moment.astimezone(UTC)
    except OverflowError as error:
        raise ValueError("this time does not exist in UTC") from error


Moment = Annotated[AwareDatetime, AfterValidator(_utc)]


class BaseMessage(BaseModel):
    """What all have in common."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    version: Literal[2] = 2
    if TYPE_CHECKING:  # each kind has its own, behind the fields that it shares with others
        kind: str

    @property
    def payload(self) -> Payload | None:
        """What says which arrays follow this header."""
        return None


class ToHub(BaseMessage):
    """What the hub is told."""


class FromHub(BaseMessage):
    """What the hub says."""


class BaseRequest(ToHub):
    """A client asks."""

    request: Number
    """Chosen by the client, repeated in the answer."""


class BaseAnswer(FromHub):
    """The hub answers."""

    request: Number = 0
    """The request answered; 0 where nobody asked: a publication."""
