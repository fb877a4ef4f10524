"""What the page of `denseface view` is told: the mirror of `frontend/src/view/messages.ts`."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from denseface.service.kiosk.page_messages import Measurement
from denseface.service.protocol.message_base import Number

__all__ = ["Fact", "ItemHead", "Listing", "Seen"]


class _Said(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ItemHead(_Said):
    """One thing that can be looked at."""

    name: str
    """File, recording or capture, as it was named."""
    kind: Literal["face", "frames", "capture", "mesh"]
    first: Number = 0
    """The frame that is shown first."""
    frames: Annotated[int, Field(ge=1)] | None = None
    """How many there are to step through; None where that is not known."""


class Listing(_Said):
    """All that can be looked at."""

    kind: Literal["listing"] = "listing"
    items: tuple[ItemHead, ...]
    version: str
    once: bool = False
    """The server ends when the last page is closed."""


class Fact(_Said):
    """A line of a table: what, and how much."""

    name: str
    value: str


class Seen(_Said):
    """What is to be said of one frame of one thing; its shape is fetched by itself."""

    kind: Literal["seen"] = "seen"
    shape: Literal["face", "mesh", "none"]
    """A face's grid, a mesh (`service.view.meshes`), or none: `problem` says why."""
    title: str
    problem: str = ""
    picture: bool = False
    """Whether there is a picture of what was looked at."""
    figures: tuple[Fact, ...] = ()
    measurements: tuple[Measurement, ...] = ()
    warnings: tuple[str, ...] = ()
    provenance: tuple[Fact, ...] = ()
    report: str = ""
    """All of a face's report, JSON; empty where there is none."""
