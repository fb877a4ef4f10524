"""What a recording made here says of its frames, which no other record of an `.oni` has."""

from datetime import datetime
from typing import Annotated, Self

from pydantic import BaseModel, ConfigDict, StringConstraints, ValidationError, field_validator

from denseface.capture.calibration import Calibration
from denseface.capture.errors import UnreadableSourceError
from denseface.capture.frame import DepthRounding, RgbdFrame
from denseface.validation import complaint

__all__ = ["Description"]


_Line = Annotated[str, StringConstraints(max_length=1024, pattern=r"^[^\x00-\x1f]*$")]


class Description(BaseModel):
    """Of all frames of a recording, taken from its first."""

    model_config = ConfigDict(frozen=True, extra="ignore")

    calibration: Calibration
    calibration_origin: _Line
    depth_rounding: DepthRounding
    sensor: _Line = ""
    captured_at: _Line = ""
    """When the first depth image was exposed, ISO 8601, UTC; empty where it is not known."""

    @field_validator("captured_at")
    @classmethod
    def _is_a_time(cls, text: str) -> str:
        if text:
            datetime.fromisoformat(text)
        return text

    @classmethod
    def of(cls, frame: RgbdFrame) -> Self:
        """Describe the recording that begins with this frame."""
        return cls(calibration=frame.calibration, calibration_origin=frame.calibration_origin,
                   depth_rounding=frame.depth_meaning.rounding, sensor=frame.origin.sensor,
                   captured_at=frame.origin.captured_at)

    @classmethod
    def read(cls, name: str, value: bytes) -> Self:
        """Read the property's value.

        Raises
        ------
        UnreadableSourceError
            One line that names the file and what is wrong.
        """
        try:
            return cls.model_validate_json(value.rstrip(b"\0"))
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            where = ".".join(map(str, first["loc"])) or "JSON"
            raise UnreadableSourceError(
                f"{name}: its description: {where}: {complaint(first)}") from error
