"""What a person in front of the sensor could do better: part of messages and of previews."""

from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, FailFast, Field, model_validator

MAX_HINT_BYTES = 800
"""Longest hint as JSON, bytes: a whole message on topic `hints` stays below 1 kB."""

Code = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]{0,39}$")]
"""Name of a fault or a measure, for programs."""


class Hint(BaseModel):
    """The quality of one frame: what is wrong with it, as codes and in words, and its measures."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    timestamp_us: Annotated[int, Field(ge=-(2**63), lt=2**63)]
    """Of the frame's depth image, sensor clock, microseconds."""
    codes: Annotated[tuple[Code, ...], Field(max_length=8), FailFast()] = ()
    """What is wrong, the most important first; empty where a press now is worth it."""
    text: Annotated[str, Field(max_length=200)] = ""
    """The first of them in words, for the person: "come closer". Each is said long enough to be
    read, so it may still be that of a frame before."""
    measures: Annotated[dict[Code, float], Field(default_factory=dict, max_length=24)]
    """What was measured, each in the unit that its name ends with."""

    @property
    def ok(self) -> bool:
        """Nothing is wrong with the frame."""
        return not self.codes

    @model_validator(mode="after")
    def _short(self) -> Self:
        size = len(self.model_dump_json().encode())
        if size > MAX_HINT_BYTES:
            raise ValueError(f"the hint has {size} bytes, at most {MAX_HINT_BYTES} allowed")
        return self
