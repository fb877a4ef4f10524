"""The whole face in a `.npz` and back: both clouds, normals, sigma, grid, report."""

import io
import zlib
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from pydantic import ValidationError

from denseface.recon.face import DenseCloud, Face, PointCloud, Report
from denseface.service.errors import FormatError, first_error, reason_of


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
            initial = PointCloud(file["initial_points"], file["initial_colors"])
            points, colors, normals, sigma, cells = (file[f"dense_{name}"] for name in (
                "points", "colors", "normals", "sigma", "cells"))
            rows, columns = file["grid_shape"].tolist()
            dense = DenseCloud(points, colors, normals, sigma, cells, (rows, columns),
                               float(file["grid_step_mm"]))
            return Face(initial, dense, Report.model_validate_json(str(file["report"])))
    except ValidationError as error:
        field, message = first_error(error)
        raise FormatError(f"{path}: report: {field}: {message}") from error
    except (OSError, EOFError, ValueError, TypeError, LookupError, BadZipFile, zlib.error) as error:
        raise FormatError(f"{path}: {reason_of(error)}") from error
