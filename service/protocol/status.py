"""The status of the service; part of `service.protocol.messages`."""

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, FailFast, Field, field_validator

from denseface.service.protocol.message_base import (
    BaseAnswer,
    Name,
    Names,
    Number,
    PeerName,
    Token,
)
from denseface.service.protocol.sensor_messages import SensorFigures
from denseface.service.runtime.terminal import printable
from denseface.short_repr import short_repr

MAX_SENSOR_STATES = 64
"""Sensors whose state a status tells: so many fit into a header, whatever their reasons are."""

MAX_COMPILING = 64
"""Workers of which a status tells that they compile."""

_TimeS = Annotated[float, Field(ge=0)]
_Counts = Annotated[dict[Name, Number], Field(default_factory=dict, max_length=64)]


class Latency(BaseModel):
    """How long one stage took since the hub started, estimated from its histogram."""

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    count: Number
    median_s: _TimeS
    p99_s: _TimeS


class Restarts(BaseModel):
    """How often one process of `denseface up` had to be started again since that began, and why."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    exited: Number = 0
    hung: Number = 0
    """It was silent for too long and was ended for it."""
    last: Name = ""
    """How it ended last: `status 1`, `SIGSEGV` or `it hung`, and why, as far as it said."""

    @field_validator("last", mode="before")
    @classmethod
    def _shortened(cls, text: object) -> object:
        return printable(text)[:200] if isinstance(text, str) else text


class SensorStatus(BaseModel):
    """One sensor, as its capture process last said."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: Name
    state: Name
    """A `LiveStateName`; `streaming` where the process does not say."""
    reason: Name = ""
    """Why it does not stream: the first 200 characters."""
    identity: Name = ""
    """Serial number, USB port or address."""
    figures: SensorFigures = SensorFigures()


class Compiling(BaseModel):
    """A worker that is not ready yet, as its kernels are compiled: by itself or another process."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    name: PeerName
    done: Number
    """Kernels that stand ready."""
    total: Number


class Status(BaseAnswer):
    """Published on topic `status` at every heartbeat.

    The one message that may gain fields within a version: a reader ignores fields that it does not
    know, and those that an older hub does not send have their default.
    """

    model_config = ConfigDict(frozen=True, extra="ignore", allow_inf_nan=False)

    kind: Literal["status"] = "status"
    epoch: Token
    sequence: Number
    """Of the last outcome."""
    hub_version: Name
    sensors: Names
    """Those that a press may ask: they stream, or are about to."""
    workers: Names
    pressed: Number
    """Presses that wait for their frame."""
    queued: Number
    working: Number
    done: Number
    failed: Number
    dead: Number
    refused: _Counts
    """Connections and messages refused since the hub started, by reason."""
    presses_refused: _Counts
    """Since the hub started, by reason."""
    since_start: _Counts
    """What happened how often since the hub started: `accepted`, `redelivered` and others."""
    latencies: Annotated[dict[Name, Latency], Field(default_factory=dict, max_length=64)]
    """By stage."""
    restarts: Annotated[dict[Name, Restarts], Field(default_factory=dict, max_length=300)]
    """By process, of those that `denseface up` had to start again."""
    free_bytes: Number | None = None
    """Room left on the disk."""
    kept_bytes: Number | None = None
    """Size of the files kept."""
    log_lines_lost: Number = 0
    """Lines of the hub's log that could not be written, since it started."""
    state: Name = "serving"
    """`opening` while the hub opens its data folder after a start, `rebuilding` while it makes rows
    again from files: then nothing else is known, and requests wait."""
    files_read: Number = 0
    """While it is `rebuilding`."""
    files_to_read: Number = 0
    sensor_states: Annotated[tuple[SensorStatus, ...], Field(max_length=MAX_SENSOR_STATES),
                             FailFast()] = ()
    """All sensors, the first of them where there are more."""

    obstacle: Name = ""
    """Why a press is refused now whatever the sensor, a `PressReason`: `queue`, or `disk` that is
    full or fails. Empty where it is not."""
    retention_s: Annotated[float, Field(gt=0)] | None = None
    """How long a capture is kept after its outcome; None where nothing is removed by itself, or an
    older hub does not say."""
    heartbeat_s: Annotated[float, Field(gt=0)] = 1.0
    """Longest time between two statuses that are published."""
    compiling: Annotated[tuple[Compiling, ...], Field(max_length=MAX_COMPILING), FailFast()] = ()
    """Workers that will be ready when their kernels are; the first where there are more."""

    def __repr__(self) -> str:
        return short_repr(
            self, "ready" if self.ready else self.obstacle or self.state,
            f"sensors: {' '.join(self.sensors) or 'none'}",
            f"{len(self.workers)} worker{'s' * (len(self.workers) != 1)}",
            f"{self.queued + self.working} waiting", f"{self.done} done")

    __str__ = __repr__

    @property
    def ready(self) -> bool:
        """A press now would become a face."""
        return (self.state == "serving" and not self.obstacle and self.has_frames
                and bool(self.workers))

    @property
    def has_frames(self) -> bool:
        """A sensor streams, or is about to; one that is being opened may yet turn out not to."""
        if not self.sensor_states:  # an older hub's
            return bool(self.sensors)
        return any(one.state in ("streaming", "warming") for one in self.sensor_states)

    @property
    def kernels(self) -> str:
        """How far the workers are that compile their kernels; empty where none does."""
        if not self.compiling:
            return ""
        done, total = max((one.done, one.total) for one in self.compiling)
        who = ("a worker compiles its" if len(self.compiling) == 1 else
               f"{len(self.compiling)} workers compile their")
        return f"{who} kernels, {done} of {total}"
