"""Messages of an operator and their answers; part of `service.protocol.messages`."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, FailFast, Field, model_validator

from denseface.service.protocol.message_base import (
    BaseAnswer,
    BaseRequest,
    CaptureId,
    Moment,
    Name,
    Number,
)

__all__ = ["DeadLetter", "DeadLetters", "DropDead", "ListDead", "Purge", "Removed", "RetryDead"]


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


class DeadLetters(BaseAnswer):
    """The answer to `ListDead`."""

    kind: Literal["dead_letters"] = "dead_letters"
    letters: Annotated[tuple[DeadLetter, ...], Field(max_length=50), FailFast()]
    """None where there are no more."""


class Removed(BaseAnswer):
    """The answer to `DropDead` and `Purge`."""

    kind: Literal["removed"] = "removed"
    removed: Number
    """Captures removed now."""
    left: bool
    """More are to be removed: repeat the request."""
