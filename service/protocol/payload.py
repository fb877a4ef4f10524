"""Frames, faces and previews on the wire: a header that fixes every shape, then raw arrays.

`layout` derives from the header which arrays follow and how large each is, so no claim of the other
side about its buffers needs to be trusted.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import (
    BaseModel,
    ConfigDict,
    FailFast,
    Field,
    ValidationError,
    field_validator,
    model_validator,
)

from denseface.capture import (
    MAX_BURST,
    Calibration,
    CaptureError,
    DepthMeaning,
    DepthRounding,
    FrameOrigin,
    RgbdFrame,
)
from denseface.recon.face import Face, PointCloud, Report
from denseface.service.errors import LocalProtocolError, RemoteProtocolError, first_error
from denseface.service.protocol.hint import Hint
from denseface.service.protocol.jpeg import jpeg_size
from denseface.service.protocol.packing import PackedCloud, pack, unpack

MAX_ARRAY_BYTES = 32 * 2**20
"""Largest single array; also MAXMSGSIZE of every socket."""
MAX_PAYLOAD_BYTES = 96 * 2**20
"""Largest sum of a message's arrays."""
MAX_PREVIEW_SIDE = 640
"""Longest side of a preview, pixels."""
MAX_JPEG_BYTES = 256 * 1024
"""Largest JPEG of a preview: that of noise at 640 x 480 and quality 85 has 250 kB, a face's 30."""
_INITIAL_POINT_BYTES, _DENSE_POINT_BYTES = 15, 39
"""Size of a point of either cloud in memory."""

Arrays = Mapping[str, NDArray[Any]]
"""Arrays by their names in the header."""

_Count = Annotated[int, Field(gt=0, le=2**24)]
_Side = Annotated[int, Field(ge=1, le=MAX_PREVIEW_SIDE)]
_Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
_MAX_LINE, _MAX_NOTE = 256, 1000
"""Characters of a frame's line of text and of a note."""
_Line = Annotated[str, Field(max_length=_MAX_LINE)]
_Note = Annotated[str, Field(max_length=_MAX_NOTE)]
_DType = Literal["<u2", "|u1", "<f4", "<i2", "<f2"]
_ITEM_BYTES = {"<u2": 2, "|u1": 1, "<f4": 4, "<i2": 2, "<f2": 2}
"""Size of one element of each dtype."""


@dataclass(frozen=True)
class ArrayInfo:
    """One raw buffer: little-endian, C order."""

    # A dataclass is made in a fifth of a model's time, once for each array of each message.
    __pydantic_config__ = ConfigDict(extra="forbid")

    name: Annotated[str, Field(max_length=32)]
    dtype: _DType
    shape: Annotated[tuple[Annotated[int, Field(ge=0, le=2**31)], ...], Field(max_length=3)]

    @property
    def nbytes(self) -> int:
        """Size of the buffer."""
        return _ITEM_BYTES[self.dtype] * math.prod(self.shape)


class _PayloadHeader(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    arrays: Annotated[tuple[ArrayInfo, ...], Field(max_length=16), FailFast()] = ()
    """The buffers that follow, in order; filled in from `layout` where not given."""

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Return the arrays that must follow this header."""
        raise NotImplementedError

    @model_validator(mode="after")
    def _checked(self) -> Self:
        expected = self.layout()
        if not self.arrays:
            object.__setattr__(self, "arrays", expected)
        elif self.arrays != expected:
            raise ValueError(f"arrays must be {_names(expected)}, found {_names(self.arrays)}")
        for info in expected:
            if info.nbytes > MAX_ARRAY_BYTES:
                raise ValueError(
                    f"array {info.name} has {info.nbytes} bytes, at most {MAX_ARRAY_BYTES} allowed")
        total = sum(info.nbytes for info in expected)
        if total > MAX_PAYLOAD_BYTES:
            raise ValueError(f"arrays have {total} bytes, at most {MAX_PAYLOAD_BYTES} allowed")
        return self


class FrameHeader(_PayloadHeader):
    """All of an `RgbdFrame` but its images."""

    calibration: Calibration
    depth_timestamp_us: _Int64
    color_timestamp_us: _Int64
    registered: bool = False
    calibration_origin: Annotated[str, Field(max_length=4096)] = "unspecified"
    has_color: bool = True
    depth_unit_um: int = 1000
    depth_rounding: DepthRounding = DepthRounding.ROUND
    depth_max_mm: Annotated[int, Field(ge=1)] | None = None
    sensor: _Line = ""
    captured_at: _Line = ""
    source: _Line = ""
    exposed_after_press_ms: float | None = None
    exposure_known_by: _Line = ""
    skew_known_by: _Line = ""
    fused: Annotated[int, Field(ge=1, le=MAX_BURST)] = 1
    notes: Annotated[tuple[_Note, ...], Field(max_length=32), FailFast()] = ()

    @field_validator("source")
    @classmethod
    def _is_a_line(cls, text: str) -> str:
        if not text.isprintable():
            raise ValueError("must be a line of text")
        return text

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Return depth, and colour where there is one, as large as the calibration says."""
        color = self.calibration.color
        depth = color if self.registered else self.calibration.depth
        images: tuple[ArrayInfo, ...] = (_info("depth", "<u2", depth.height, depth.width),)
        if self.has_color:
            images += (_info("color", "|u1", color.height, color.width, 3),)
        return images

    @classmethod
    def of(cls, frame: RgbdFrame) -> tuple[Self, Arrays]:
        """Take a frame apart."""
        meaning, origin = frame.depth_meaning, frame.origin
        header = cls(
            calibration=frame.calibration, depth_timestamp_us=frame.depth_timestamp_us,
            color_timestamp_us=frame.color_timestamp_us, registered=frame.registered,
            calibration_origin=frame.calibration_origin[:4096], has_color=frame.color is not None,
            depth_unit_um=meaning.unit_um, depth_rounding=meaning.rounding,
            depth_max_mm=meaning.max_mm, sensor=origin.sensor[:_MAX_LINE],
            captured_at=origin.captured_at, source=origin.source[:_MAX_LINE], fused=origin.fused,
            exposed_after_press_ms=origin.exposed_after_press_ms,
            exposure_known_by=origin.exposure_known_by, skew_known_by=origin.skew_known_by,
            notes=tuple(note[:_MAX_NOTE] for note in origin.notes[:32]))
        images: dict[str, NDArray[Any]] = {"depth": frame.depth}
        if frame.color is not None:
            images["color"] = frame.color
        return header, images

    def join(self, arrays: Arrays) -> RgbdFrame:
        """Put the frame together again; RemoteProtocolError where they do not make one."""
        try:
            return RgbdFrame(
                arrays["depth"], arrays["color"] if self.has_color else None,
                self.depth_timestamp_us, self.color_timestamp_us,
                self.calibration, self.registered, calibration_origin=self.calibration_origin,
                depth_meaning=DepthMeaning(
                    self.depth_unit_um, self.depth_rounding, self.depth_max_mm),
                origin=FrameOrigin(
                    self.sensor, self.captured_at, self.exposed_after_press_ms,
                    self.exposure_known_by, self.skew_known_by, self.fused, self.notes,
                    self.source))
        except (CaptureError, KeyError) as error:
            raise RemoteProtocolError(f"frame: {error}") from error


class FaceHeader(_PayloadHeader):
    """All of a `Face` but its points."""

    report: Report
    initial_points: _Count
    dense_points: _Count
    grid_shape: tuple[_Count, _Count]
    grid_step_mm: Annotated[float, Field(gt=0)]

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Return both clouds, the dense one packed, as large as counts and grid say."""
        n, m = self.initial_points, self.dense_points
        rows, columns = self.grid_shape
        return (_info("initial_points", "<f4", n, 3), _info("initial_colors", "|u1", n, 3),
                _info("dense_support", "|u1", rows, -(-columns // 8)),
                _info("dense_x", "<f4", columns), _info("dense_y", "<f4", rows),
                _info("dense_z", "<f4", m), _info("dense_colors", "|u1", m, 3),
                _info("dense_normals", "<i2", m, 2), _info("dense_sigma", "<f2", m))

    @model_validator(mode="after")
    def _unpacks(self) -> Self:
        """Bound what is unpacked, which is several times as large."""
        rows, columns = self.grid_shape
        if rows * columns > MAX_ARRAY_BYTES:
            raise ValueError(f"the grid has {rows} x {columns} places, "
                             f"at most {MAX_ARRAY_BYTES} allowed")
        size = _INITIAL_POINT_BYTES * self.initial_points + _DENSE_POINT_BYTES * self.dense_points
        if size > MAX_PAYLOAD_BYTES:
            raise ValueError(f"both clouds have {size} bytes, at most {MAX_PAYLOAD_BYTES} allowed")
        return self

    @classmethod
    def of(cls, face: Face) -> tuple[Self, Arrays]:
        """Take a face apart; LocalProtocolError where its dense cloud cannot be packed."""
        try:
            dense = pack(face.dense)
        except ValueError as error:
            raise LocalProtocolError(f"face: {error}") from error
        header = cls(
            report=face.report, initial_points=len(face.initial), dense_points=len(dense.z),
            grid_shape=dense.grid_shape, grid_step_mm=dense.grid_step_mm)
        return header, {
            "initial_points": face.initial.points, "initial_colors": face.initial.colors,
            "dense_support": dense.support, "dense_x": dense.x, "dense_y": dense.y,
            "dense_z": dense.z, "dense_colors": dense.colors, "dense_normals": dense.normals,
            "dense_sigma": dense.sigma}

    def check(self, arrays: Arrays) -> None:
        """Check in a fraction of the time of `join` that it would succeed; raises as it.

        Also that the dense cloud's columns and rows are as far apart as the header says.
        """
        _, dense = self._clouds(arrays)
        try:
            dense.check_grid()
        except ValueError as error:
            raise RemoteProtocolError(f"face: {error}") from error

    def join(self, arrays: Arrays) -> Face:
        """Put the face together again.

        RemoteProtocolError where header and arrays make none, or a coordinate is not finite.
        """
        initial, dense = self._clouds(arrays)
        return Face(initial, unpack(dense), self.report)

    def _clouds(self, arrays: Arrays) -> tuple[PointCloud, PackedCloud]:
        said = self.report.initial_points, self.report.dense_points
        if said != (self.initial_points, self.dense_points):
            raise RemoteProtocolError(
                f"face: the report has {said[0]} and {said[1]} points, the face has "
                f"{self.initial_points} and {self.dense_points}")
        try:
            return PointCloud(arrays["initial_points"], arrays["initial_colors"]), PackedCloud(
                arrays["dense_support"], arrays["dense_x"], arrays["dense_y"], arrays["dense_z"],
                arrays["dense_colors"], arrays["dense_normals"], arrays["dense_sigma"],
                self.grid_shape, self.grid_step_mm)
        except (ValueError, KeyError) as error:
            raise RemoteProtocolError(f"face: {error}") from error


class PreviewHeader(_PayloadHeader):
    """A small picture of what the sensor sees."""

    width: _Side
    height: _Side
    timestamp_us: _Int64
    """Of the colour image, sensor clock, microseconds."""
    encoding: Literal["rgb", "jpeg"] = "rgb"
    jpeg_bytes: Annotated[int, Field(ge=1, le=MAX_JPEG_BYTES)] | None = None
    """Size of the JPEG; given where the encoding is that one."""
    sensor: Annotated[str, Field(max_length=100)] = ""
    """Name of the sensor, as the hub knows it."""
    hint: Hint | None = None
    """Of the frame that the picture shows; None where its quality was not measured."""

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Return the picture: its pixels, or the bytes of a JPEG."""
        if self.jpeg_bytes is not None:
            return (_info("jpeg", "|u1", self.jpeg_bytes),)
        return (_info("image", "|u1", self.height, self.width, 3),)

    @model_validator(mode="after")
    def _encoded(self) -> Self:
        if (self.encoding == "jpeg") != (self.jpeg_bytes is not None):
            raise ValueError("expected jpeg_bytes with the encoding jpeg, and only there")
        return self

    @classmethod
    def of_jpeg(
        cls, data: bytes, timestamp_us: int, hint: Hint | None = None
    ) -> tuple[Self, Arrays]:
        """Describe a JPEG; LocalProtocolError where it is none that may be sent."""
        try:
            width, height = jpeg_size(data)
            header = cls(width=width, height=height, timestamp_us=timestamp_us, encoding="jpeg",
                         jpeg_bytes=len(data), hint=hint)
        except ValidationError as error:
            raise LocalProtocolError(": ".join(("preview", *first_error(error)))) from error
        except ValueError as error:
            raise LocalProtocolError(f"preview: the picture {error}") from error
        return header, {"jpeg": np.frombuffer(data, np.uint8)}

    def check(self, arrays: Arrays) -> None:
        """Check that a JPEG is one of the size that the header says: RemoteProtocolError."""
        if self.jpeg_bytes is None:
            return
        try:
            size = jpeg_size(arrays["jpeg"].data)
        except ValueError as error:
            raise RemoteProtocolError(f"preview: the picture {error}") from error
        if size != (self.width, self.height):
            raise RemoteProtocolError(
                f"preview: the picture has {size[0]} x {size[1]} pixels, its header says "
                f"{self.width} x {self.height}")


Payload = FrameHeader | FaceHeader | PreviewHeader


def _info(name: str, dtype: _DType, *shape: int) -> ArrayInfo:
    return ArrayInfo(name, dtype, shape)


def _names(infos: tuple[ArrayInfo, ...]) -> str:
    return ", ".join(f"{info.name} {info.dtype} {list(info.shape)}" for info in infos)
