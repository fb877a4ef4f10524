"""The whole face in a `.npz` and back: both clouds, normals, sigma, grid, report."""

import io
import zlib
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from pydantic import ValidationError

from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.service.errors import FormatError, first_error, reason_of

__all__ = ["from_npz", "to_npz"]

_ARRAYS = ("initial_points", "initial_colors", "dense_points", "dense_colors", "dense_normals",
           "dense_sigma", "dense_cells", "grid_shape", "grid_step_mm", "report")
"""Keys of the file; the report is JSON."""


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
        with np.load(path, allow_pickle=False) as file:
            of = {name: file[name] for name in _ARRAYS}
        rows, columns = of["grid_shape"].tolist()
        return Face(
            PointCloud(of["initial_points"], of["initial_colors"]),
            DenseCloud(of["dense_points"], of["dense_colors"], of["dense_normals"],
                       of["dense_sigma"], of["dense_cells"], (rows, columns),
                       float(of["grid_step_mm"])),
            Report.model_validate_json(str(of["report"])))
    except ValidationError as error:
        field, message = first_error(error)
        raise FormatError(f"{path}: report: {field}: {message}") from error
    except (OSError, EOFError, ValueError, TypeError, LookupError, BadZipFile, zlib.error) as error:
        raise FormatError(f"{path}: {reason_of(error)}") from error
