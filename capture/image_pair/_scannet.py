"""ScanNet's intrinsics: 4 x 4 matrices as text."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.errors import CalibrationError
from denseface.files import read_bounded

__all__ = ["scannet_calibration"]

_MAX_FILE_BYTES = 1 << 16
_DEPTH_SIZE, _COLOR_SIZE = (640, 480), (1296, 968)
"""Pixels, of the images that the matrices are of: a Structure sensor on an iPad."""
_M_TO_MM = 1000.0


def scannet_calibration(folder: Path, intrinsic: str = "intrinsic") -> Calibration:
    """Read `intrinsic_depth.txt`, `intrinsic_color.txt` and the extrinsics of both.

    Parameters
    ----------
    intrinsic : how the names of the first two begin; `intrinsics` in `scannet_frames_25k`

    An extrinsic matrix takes points from its camera to the device, in metres; one that is not
    there is the identity, as nearly all of the data set's are.

    Raises
    ------
    CalibrationError
        A file is missing, or holds no such matrix.
    """
    depth, color = (_camera(folder / f"{intrinsic}_{name}.txt", size)
                    for name, size in (("depth", _DEPTH_SIZE), ("color", _COLOR_SIZE)))
    to_device, from_device = (
        _matrix(path) if (path := folder / f"extrinsic_{name}.txt").exists() else np.eye(4)
        for name in ("depth", "color"))
    try:
        pose = np.linalg.inv(from_device) @ to_device
        return Calibration(depth=depth, color=color, depth_to_color=DepthToColor(
            rotation=pose[:3, :3].tolist(), translation_mm=(pose[:3, 3] * _M_TO_MM).tolist()))
    except ValueError as error:  # numpy's of a singular matrix, too
        raise CalibrationError(f"{folder}: extrinsic_depth.txt and extrinsic_color.txt are no "
                               "poses (a rotation, a translation in metres)") from error


def _camera(path: Path, size: tuple[int, int]) -> CameraModel:
    matrix = _matrix(path)
    try:
        return CameraModel(width=size[0], height=size[1], fx=matrix[0, 0], fy=matrix[1, 1],
                           cx=matrix[0, 2], cy=matrix[1, 2])
    except ValueError as error:
        raise CalibrationError(
            f"{path}: focal length {matrix[0, 0]:g}, {matrix[1, 1]:g} and centre "
            f"{matrix[0, 2]:g}, {matrix[1, 2]:g} are of no camera of {size[0]}x{size[1]}"
        ) from error


def _matrix(path: Path) -> NDArray[np.float64]:
    try:
        numbers = [float(word) for word in read_bounded(path, _MAX_FILE_BYTES).split()]
    except OSError as error:
        raise CalibrationError(f"{path}: {error.strerror or error}") from error
    except ValueError:
        numbers = []
    if len(numbers) != 16 or not np.isfinite(numbers).all():
        raise CalibrationError(f"{path}: expected a matrix of 4 x 4 numbers")
    return np.array(numbers).reshape(4, 4)
