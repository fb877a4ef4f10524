"""What became of one frame of an archive: plain values, as they go between processes and files."""

from collections.abc import Mapping
from pathlib import PurePosixPath
from typing import Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from denseface.checked_model import first_line
from denseface.recon.face import Face
from denseface.service.errors import FormatError

__all__ = ["MAX_SOURCE", "MAX_THUMBNAIL_BYTES", "MAX_WARNINGS", "MAX_WHY", "STATES", "Row",
           "RowKey", "State", "told"]

State = Literal["face", "no_face", "unreadable", "failed"]
STATES: tuple[State, ...] = ("face", "no_face", "unreadable", "failed")
MAX_THUMBNAIL_BYTES = 6 * 1024
MAX_SOURCE, MAX_WHY, MAX_WARNINGS, _MAX_WARNING = 4096, 500, 20, 300
"""Characters of a path and of a reason, how many warnings, characters of each."""
_MAX_NUMBER = 2**31 - 1
"""Of a frame, of points and of attempts: columns of 32 bits hold it."""
_PICTURES = b"RIFF", b"\xff\xd8\xff"
"""First bytes of a WebP and a JPEG file."""


class RowKey(NamedTuple):
    """What no two rows of a summary have in common."""

    source: str
    frame: int | None


def told(path: str) -> str:
    """Give a path as a row has it: a file's name need not be UTF-8, a text in a table has to be."""
    return path.encode("utf-8", "backslashreplace").decode()


def _path(text: Any) -> Any:
    return told(text) if isinstance(text, str) else text


def _line(text: Any, most: int) -> Any:
    """Make a line of a text, and cut it to a length: an error may say anything."""
    if not isinstance(text, str):
        return text
    line = " ".join(_path(text[:4 * most]).split())
    return line if len(line) <= most else line[:most - 3] + "..."


_Path = BeforeValidator(_path)
_Count = Annotated[int, Field(ge=0, le=_MAX_NUMBER, strict=True)]
_Length = Annotated[float, Field(ge=0)] | None


class Row(BaseModel):
    """What became of one frame.

    Texts are made one line and cut, as what an error says may be anything. pydantic's
    ValidationError, a ValueError, where a field is impossible.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    source: Annotated[str, Field(min_length=1, max_length=MAX_SOURCE), _Path]
    """File or folder, as given; bytes that are no UTF-8 are escaped."""
    frame: _Count | None
    """Its number in the source, from 0; None where the source could not be opened."""
    state: State
    """`face`; `no_face`: nobody was found; `unreadable`; `failed`: an error, or its worker died."""
    output: Annotated[str, Field(max_length=MAX_SOURCE), _Path] | None = None
    """File of the face, relative to the folder of the summary; None where there is none."""
    error: Annotated[str, Field(pattern=r"^([A-Za-z_][A-Za-z0-9_]{0,99})?$")] = ""
    """Name of the error's class; empty where there is none."""
    why: Annotated[str, BeforeValidator(lambda text: _line(text, MAX_WHY))] = ""
    """Why there is no face, in one line."""
    measured: _Count = 0
    """Points that the sensor measured on the face."""
    dense: _Count = 0
    """Points of the dense face."""
    sigma_mm: _Length = None
    """Median standard error of the dense points, mm."""
    mean_spacing_mm: _Length = None
    """Mean distance of neighbouring measured points, mm."""
    noise_mm: _Length = None
    """Standard deviation of the noise of depth, mm."""
    face_score: Annotated[float, Field(ge=0, le=1)] | None = None
    """How sure it is that this is a face, by its shape, 0-1."""
    seconds: Annotated[float, Field(ge=0)] = 0.0
    """Wall time that the frame took its worker, with reading and writing, seconds."""
    worker: Annotated[str, BeforeValidator(lambda text: _line(text, 200))] = ""
    """Which worker had it last."""
    attempts: _Count = 1
    """How often it was tried, in this run and earlier ones."""
    warnings: tuple[
        Annotated[str, BeforeValidator(lambda text: _line(text, _MAX_WARNING))], ...] = ()
    """Of the face's report; the first ones, where there are many."""
    thumbnail: Annotated[bytes, Field(max_length=MAX_THUMBNAIL_BYTES, strict=True)] = b""
    """A small picture, WebP or JPEG; empty where there is none."""

    @model_validator(mode="before")
    @classmethod
    def _cut(cls, given: Any) -> Any:
        warnings = given.get("warnings") if isinstance(given, dict) else None
        if isinstance(warnings, list | tuple) and len(warnings) > MAX_WARNINGS:
            return given | {"warnings": warnings[:MAX_WARNINGS]}
        return given

    @model_validator(mode="after")
    def _whole(self) -> Self:
        if (self.state == "face") == bool(self.error or self.why):
            raise ValueError(f"expected a reason with every state but face, found {self.state} "
                             f"and {self.why or self.error!r}")
        if self.output is not None:
            parts = PurePosixPath(self.output)
            if parts.is_absolute() or ".." in parts.parts or not parts.parts:
                raise ValueError("output: expected a path within the folder of the summary, found "
                                 f"{self.output!r}")
        if self.thumbnail and not self.thumbnail.startswith(_PICTURES):
            raise ValueError("thumbnail: expected a WebP or JPEG file")
        return self

    @property
    def key(self) -> RowKey:
        """Give what no other row of the summary has."""
        return RowKey(self.source, self.frame)

    def as_dict(self) -> dict[str, Any]:
        """Give plain values by name, for a message between processes: no class of this package."""
        return dict(self)

    @classmethod
    def from_dict(cls, given: Mapping[str, Any]) -> Self:
        """Read what `as_dict` gave, from another process or a file.

        Raises
        ------
        FormatError
            It is no row; the line names the first field that is wrong.
        """
        if not isinstance(given, Mapping) or not all(isinstance(name, str) for name in given):
            raise FormatError(f"expected a row of a summary, found {type(given).__name__}")
        try:
            return cls(**given)
        except ValidationError as error:
            raise FormatError(first_line(error)) from error

    @classmethod
    def of_face(cls, source: str, frame: int | None, face: Face, **more: Any) -> Self:
        """Give the row of a face; `more` are fields that a face does not know, such as `worker`."""
        report = face.report
        return cls(
            source=source, frame=frame, state="face", measured=report.initial_points,
            dense=report.dense_points, sigma_mm=float(np.median(face.dense.sigma)),
            mean_spacing_mm=report.mean_spacing_mm, noise_mm=report.noise_mm,
            face_score=report.face_score, warnings=report.warnings, **more)
