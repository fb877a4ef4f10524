"""Settings of the service: addresses, folders, limits and time-outs."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError

from denseface.folders import user_folder
from denseface.service.errors import FrameTooLargeError, SettingsError, first_error
from denseface.service.runtime.parsing import parse_loopback_address, parse_retention

if TYPE_CHECKING:
    from denseface.capture import Calibration

__all__ = ["ServiceSettings", "check_frame_size", "default_address", "given_settings",
           "runtime_folder"]

_PREFIX = "DENSEFACE_"
_MESSAGE_PIXELS = 2**25 // 3
"""Largest colour image that an array of a message holds."""
_Seconds = Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]


def _split(given: object) -> object:
    return tuple(filter(None, given.split(","))) if isinstance(given, str) else given


def _as_text(given: object) -> object:
    return os.fspath(given) if isinstance(given, Path) else given


def runtime_folder() -> Path:
    """Give this user's socket folder: `$XDG_RUNTIME_DIR/denseface`, else a temporary one.

    It is created by `socket_folder` when the hub binds or someone connects, not here.
    """
    runtime = os.environ.get("XDG_RUNTIME_DIR", "")
    if runtime and Path(runtime).is_dir():
        return Path(runtime) / "denseface"
    return Path(tempfile.gettempdir()) / f"denseface-{os.getuid()}"


def default_address() -> str:
    """Give the address of this user's hub: a socket file that no other user can open."""
    return f"ipc://{runtime_folder() / 'hub'}"


def given_settings(
    model: type[BaseModel], prefix: str, environment: Mapping[str, str], flags: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, str]]:
    """Give the flags that are not None, and what variables of a prefix say of a model's fields."""
    given = {name: environment[prefix + name.upper()] for name in model.model_fields
             if environment.get(prefix + name.upper())}
    return {name: value for name, value in flags.items() if value is not None}, given


class ServiceSettings(BaseModel):
    """Every setting may be given as a flag or as `DENSEFACE_NAME`; the flag wins."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    address: str = Field(default_factory=default_address)
    """The hub's address: `ipc://PATH` or `tcp://HOST:PORT`."""
    listen: Annotated[tuple[str, ...], Field(max_length=16), BeforeValidator(_split)] = ()
    """More addresses of the hub, for peers with a key: `tcp://HOST:PORT`, several with commas."""
    keys: Path = Field(default_factory=lambda: user_folder("config") / "keys")
    """Folder of the keys and of the hub's allow-list."""
    key: Path | None = None
    """File of this process's own secret key."""
    # A text: a path would be another key where that has `//`, or ends in `/`.
    hub_key: Annotated[str | None, BeforeValidator(_as_text)] = None
    """The hub's public key: its file, or its 40 characters."""
    memory_mb: Annotated[int, Field(ge=64, le=2**20)] = 2048
    """Memory of the hub, MiB, beyond which it disconnects all other machines."""
    data: Path = Field(default_factory=lambda: user_folder("data"))
    """Folder of frames, faces and their database, with mode 700."""
    heartbeat_s: _Seconds = 1.0
    """Time between two heartbeats, seconds."""
    liveness: Annotated[int, Field(ge=2, le=100)] = 3
    """Missed heartbeats after which a peer counts as gone."""
    attempts: Annotated[int, Field(ge=1, le=100)] = 3
    """Times that a frame is tried before it becomes a dead letter."""
    take_timeout_s: _Seconds = 10.0
    """Longest wait for the sensor's frame after a press, seconds."""
    sensor_delay_ms: Annotated[float, Field(ge=0, le=1000)] = 70.0
    """Longest time from an exposure of a live sensor to its frame's arrival, milliseconds."""
    max_frame_pixels: Annotated[int, Field(ge=1, le=_MESSAGE_PIXELS)] = 2**23
    """Most pixels of a frame's depth or colour image; a larger frame is refused."""
    job_timeout_s: _Seconds = 60.0
    """Longest reconstruction; a worker that takes longer ends itself, seconds."""
    hang_timeout_s: _Seconds = 30.0
    """Silence after which `denseface up` ends a process, seconds; at least `silence_s` is given."""
    queue: Annotated[int, Field(ge=1, le=100_000)] = 1000
    """Frames that may wait for a worker; beyond it a press is refused."""
    retention: Annotated[float | None, BeforeValidator(parse_retention)] = 86400.0
    """Time after its outcome when a capture is removed, seconds; None for never."""
    reserve_mib: Annotated[int, Field(ge=0, le=2**30)] = 256
    """Free space of the disk, MiB, below which presses are refused."""
    metrics: Annotated[tuple[str, int] | None, BeforeValidator(parse_loopback_address)] = None
    """Host and port of `/metrics` and `/healthz`, on this machine alone; None for neither."""
    log_ids: Literal["on", "off"] = "on"
    """Whether the log shows captures' ids; else hashes of a key that each start makes anew."""
    resend_s: _Seconds = 2.0
    """Time after which an unanswered request or frame is sent again, seconds."""

    @property
    def silence_s(self) -> float:
        """Silence after which a peer counts as gone, seconds."""
        return self.heartbeat_s * self.liveness

    @classmethod
    def of(cls, environment: Mapping[str, str], **flags: Any) -> Self:
        """Take each setting from its flag, else the environment, else its default.

        A flag of None is not given.

        Raises
        ------
        SettingsError
            One line that names the flag or variable and what is wrong with it.
        """
        flags, given = given_settings(cls, _PREFIX, environment, flags)
        try:
            return cls(**(given | flags))
        except ValidationError as error:
            field, message = first_error(error, found=True)
            name = field.partition(".")[0]
            where = f"--{name.replace('_', '-')}" if name in flags else _PREFIX + name.upper()
            raise SettingsError(f"{where}: {message}") from error


def check_frame_size(cameras: "Calibration", most: int) -> None:
    """Check the cameras of a frame before anything is made of it.

    Its reconstruction takes time and memory in proportion to its pixels.

    Raises
    ------
    FrameTooLargeError
        Where its depth or colour image has more than `most` pixels.
    """
    for name, camera in (("depth", cameras.depth), ("color", cameras.color)):
        if camera.width * camera.height > most:
            raise FrameTooLargeError(
                f"{name} has {camera.width} x {camera.height} pixels, at most {most} allowed "
                f"({_PREFIX}MAX_FRAME_PIXELS)")
