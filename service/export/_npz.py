"""The whole face in a `.npz` and back: both clouds, normals, sigma, grid, report."""

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from denseface.capture.errors import CaptureError
from denseface.capture.zipped_arrays import ArrayKind, read_arrays
from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.service.errors import FormatError, first_error, reason_of

_MAX_PLACES = 2**25
"""Of the grid."""
_KINDS = {
    "initial_points": ArrayKind("float32", ("n", 3)),
    "initial_colors": ArrayKind("uint8", ("n", 3)),
    "dense_points": ArrayKind("float32", ("m", 3)),
    "dense_colors": ArrayKind("uint8", ("m", 3)),
    "dense_normals": ArrayKind("float32", ("m", 3)),
    "dense_sigma": ArrayKind("float32", ("m",)),
    "dense_cells": ArrayKind("int32", ("m", 2)),
    "grid_shape": ArrayKind("int64", (2,)),
    "grid_step_mm": ArrayKind("float64"),
    "report": ArrayKind("str"),
}
_OTHERS = {"depth": "is a frame, not a face: reconstruct(load_frame(path)) makes one"}
"""Keys of other files of ours, and what they are."""


def to_npz(face: Face) -> bytes:
    """Give the file's bytes."""
    initial, dense = face.initial, face.dense
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer, initial_points=initial.points, initial_colors=initial.colors,
        dense_points=dense.points, dense_colors=dense.colors, dense_normals=dense.normals,
        dense_sigma=dense.sigma, dense_cells=dense.cells,
        grid_shape=np.array(dense.grid_shape, np.int64),
        grid_step_mm=np.float64(dense.grid_step_mm), report=face.report.model_dump_json())
    return buffer.getvalue()


def from_npz(path: str | Path) -> Face:
    """Read a file of `to_npz`; raises as `load_face`."""
    try:
        return _to_face(read_arrays(path, _KINDS, others=_OTHERS))
    except ValidationError as error:
        field, message = first_error(error)
        raise FormatError(f"{path}: report: {field}: {message}") from error
    except CaptureError as error:
        raise FormatError(str(error)) from error
    except (ValueError, SystemError) as error:  # a text that is no Unicode is one of these
        raise FormatError(f"{path}: {reason_of(error)}") from error


def _to_face(arrays: dict[str, NDArray[Any]]) -> Face:
    """Put a face together; ValueError or ValidationError where its parts do not fit."""
    rows, columns = arrays["grid_shape"].tolist()
    if not (rows > 0 and columns > 0 and rows * columns <= _MAX_PLACES):
        raise ValueError(f"grid_shape: {rows} x {columns}, expected at most {_MAX_PLACES} places")
    step = float(arrays["grid_step_mm"])
    if not 0 < step < math.inf:
        raise ValueError(f"grid_step_mm: {step}, expected a length")
    points, colors, normals, sigma, cells = (arrays[f"dense_{name}"] for name in (
        "points", "colors", "normals", "sigma", "cells"))
    return Face(PointCloud(arrays["initial_points"], arrays["initial_colors"]),
                DenseCloud(points, colors, normals, sigma, cells, (rows, columns), step),
                Report.model_validate_json(str(arrays["report"])))
