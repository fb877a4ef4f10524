"""Frames and faces as they travel: a header that fixes every shape, then raw arrays.

The header alone decides which arrays follow and how large each is (`layout`), so nothing that the
other side says of its buffers needs to be believed.
"""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, FailFast, Field, model_validator

from capture import Calibration, CaptureError, RgbdFrame
from recon.face import DenseCloud, Face, PointCloud, Report
from service.errors import RemoteProtocolError

__all__ = ["MAX_ARRAY_BYTES", "MAX_PAYLOAD_BYTES", "MAX_PREVIEW_SIDE", "ArrayInfo", "Arrays",
           "FaceHeader", "FrameHeader", "Payload", "PreviewHeader"]

MAX_ARRAY_BYTES = 32 * 2**20
"""Largest single array; also MAXMSGSIZE of every socket."""
MAX_PAYLOAD_BYTES = 96 * 2**20
"""Largest sum of a message's arrays."""
MAX_PREVIEW_SIDE = 320
"""Longest side of a preview, pixels."""

Arrays = Mapping[str, NDArray[Any]]

_Count = Annotated[int, Field(gt=0, le=2**24)]
_Side = Annotated[int, Field(ge=1, le=MAX_PREVIEW_SIDE)]
_Int64 = Annotated[int, Field(ge=-(2**63), lt=2**63)]
_DType = Literal["<u2", "|u1", "<f4", "<i4"]


class _Model(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class ArrayInfo(_Model):
    """One raw buffer: little-endian, C order."""

    name: Annotated[str, Field(max_length=32)]
    dtype: _DType
    shape: Annotated[tuple[Annotated[int, Field(ge=0, le=2**31)], ...], Field(max_length=3)]

    @property
    def nbytes(self) -> int:
        """Size of the buffer."""
        return np.dtype(self.dtype).itemsize * math.prod(self.shape)


class _PayloadHeader(_Model):
    arrays: Annotated[tuple[ArrayInfo, ...], Field(max_length=16), FailFast()] = ()
    """The buffers that follow, in order; filled in from `layout` where not given."""

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Give the arrays that this header must be followed by."""
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

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Give depth and colour, as large as the calibration says."""
        color = self.calibration.color
        depth = color if self.registered else self.calibration.depth
        return (_info("depth", "<u2", depth.height, depth.width),
                _info("color", "|u1", color.height, color.width, 3))

    @classmethod
    def of(cls, frame: RgbdFrame) -> tuple[Self, Arrays]:
        """Take a frame apart."""
        header = cls(
            calibration=frame.calibration, depth_timestamp_us=frame.depth_timestamp_us,
            color_timestamp_us=frame.color_timestamp_us, registered=frame.registered,
            calibration_origin=frame.calibration_origin)
        return header, {"depth": frame.depth, "color": frame.color}

    def join(self, arrays: Arrays) -> RgbdFrame:
        """Put the frame together again.

        Raises
        ------
        RemoteProtocolError
            Where header and arrays do not make a frame.
        """
        try:
            return RgbdFrame(
                arrays["depth"], arrays["color"], self.depth_timestamp_us, self.color_timestamp_us,
                self.calibration, self.registered, calibration_origin=self.calibration_origin)
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
        """Give both clouds, as large as the counts say."""
        n, m = self.initial_points, self.dense_points
        return (_info("initial_points", "<f4", n, 3), _info("initial_colors", "|u1", n, 3),
                _info("dense_points", "<f4", m, 3), _info("dense_colors", "|u1", m, 3),
                _info("dense_normals", "<f4", m, 3), _info("dense_sigma", "<f4", m),
                _info("dense_cells", "<i4", m, 2))

    @classmethod
    def of(cls, face: Face) -> tuple[Self, Arrays]:
        """Take a face apart."""
        initial, dense = face.initial, face.dense
        rows, columns = dense.grid_shape
        header = cls(
            report=face.report, initial_points=len(initial), dense_points=len(dense),
            grid_shape=(int(rows), int(columns)), grid_step_mm=float(dense.grid_step_mm))
        return header, {
            "initial_points": initial.points, "initial_colors": initial.colors,
            "dense_points": dense.points, "dense_colors": dense.colors,
            "dense_normals": dense.normals, "dense_sigma": dense.sigma,
            "dense_cells": dense.cells}

    def join(self, arrays: Arrays) -> Face:
        """Put the face together again.

        Raises
        ------
        RemoteProtocolError
            Where header and arrays do not make a face, or a coordinate is not finite.
        """
        try:
            return Face(
                PointCloud(arrays["initial_points"], arrays["initial_colors"]),
                DenseCloud(
                    arrays["dense_points"], arrays["dense_colors"], arrays["dense_normals"],
                    arrays["dense_sigma"], arrays["dense_cells"], self.grid_shape,
                    self.grid_step_mm),
                self.report)
        except (ValueError, KeyError) as error:
            raise RemoteProtocolError(f"face: {error}") from error


class PreviewHeader(_PayloadHeader):
    """A small picture of what the sensor sees."""

    width: _Side
    height: _Side
    timestamp_us: _Int64
    """Of the colour image that it was made of."""

    def layout(self) -> tuple[ArrayInfo, ...]:
        """Give the picture."""
        return (_info("image", "|u1", self.height, self.width, 3),)


Payload = FrameHeader | FaceHeader | PreviewHeader


def _info(name: str, dtype: _DType, *shape: int) -> ArrayInfo:
    return ArrayInfo(name=name, dtype=dtype, shape=shape)


def _names(infos: tuple[ArrayInfo, ...]) -> str:
    return ", ".join(f"{info.name} {info.dtype} {list(info.shape)}" for info in infos)
