"""Files of other programs that describe one camera."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from denseface.capture.calibration import CameraModel
from denseface.capture.calibration_files._distortion import camera_with_distortion
from denseface.capture.errors import CalibrationError

__all__ = ["one_camera", "parse_storage"]

_MATRIX = ("camera_matrix", "cameraMatrix", "Camera_Matrix", "intrinsic_matrix", "K", "k")
"""Names of the 3x3 matrix: OpenCV's samples, ROS's `camera_info` files and messages, Open3D."""
_COLUMN_BY_COLUMN = "intrinsic_matrix"
"""Open3D writes its columns one after the other."""
_DISTORTION = ("distortion_coefficients", "distortionCoefficients", "Distortion_Coefficients",
               "dist_coeffs", "dist_coeff", "D", "d")
_WIDTH = ("image_width", "image_Width", "width")
_HEIGHT = ("image_height", "image_Height", "height")
_STEREO = ("M1", "K1", "camera_matrix_1", "cameraMatrix1")
_MODELS = ("", "plumb_bob", "rational_polynomial", "radtan", "brown_conrady")
"""Distortion models that OpenCV's coefficients stand for."""
_FISHEYE = "fisheye_model"
"""OpenCV's calibration program says so of its four coefficients, which stand for others then."""
_POSE = ("T", "translation", "T_cn_cnm1")
"""Names of a translation to another camera. R alone rectifies one."""
_HEAD_LINES = 2
_MATRIX_NUMBERS = 9
_MOST_NUMBERS = 64
"""Of a list that is read; a matrix of 4 x 4 has 16."""

Fields = Mapping[str, Any]
"""Names and what stands under them: numbers, texts, lists of numbers."""


def parse_storage(text: str) -> Fields:
    """Read OpenCV's YAML or XML, or ROS's YAML, by OpenCV's own reader.

    Raises
    ------
    CalibrationError
        Where that reader refuses it.
    """
    import cv2  # who opens no such file waits for it in vain

    text = text.lstrip()
    if not text.startswith(("%YAML", "<?xml")):
        text = _as_opencv_has_it(text)
    log = cv2.utils.logging
    before = log.setLogLevel(log.LOG_LEVEL_SILENT)
    try:
        storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
        root = storage.root()
        return {key: _value(root.getNode(key)) for key in root.keys()}  # noqa: SIM118
    except (cv2.error, SystemError) as error:
        raise CalibrationError("cannot be parsed, expected JSON, or OpenCV's or ROS's YAML or "
                               "XML") from error
    finally:
        log.setLogLevel(before)


def _as_opencv_has_it(text: str) -> str:
    """Give YAML of others in the part of YAML that OpenCV reads.

    It knows YAML by its first line, one document, and lists whose dashes stand farther right than
    their name: PyYAML and `ros2 topic echo` put them below it.
    """
    lines, name_at = ["%YAML:1.0", "---"], -1
    for line in text.splitlines():
        bare = line.strip()
        if bare in ("---", "..."):
            if len(lines) > _HEAD_LINES:
                break  # `topic echo` goes on with the next message
            continue
        at = len(line) - len(line.lstrip())
        is_item = bare == "-" or bare.startswith("- ")
        lines.append(f"  {line}" if is_item and at == name_at else line)
        if bare and not is_item and not bare.startswith("#"):
            name_at = at if bare.endswith(":") else -1
    return "\n".join([*lines, ""])


def one_camera(fields: Fields) -> CameraModel:
    """Give the camera that the fields of a file describe.

    Raises
    ------
    CalibrationError
        Something is missing, or not what it should be; to be put after the file's name.
    """
    stereo = _named(fields, _STEREO)
    if stereo and not _named(fields, _MATRIX):
        raise CalibrationError(f"has two cameras ({stereo} and the other) and not which is the "
                               "depth camera; expected depth, color and depth_to_color in JSON")
    matrix_name = _required(fields, _MATRIX)
    pose = _named(fields, _POSE)
    if pose:
        raise CalibrationError(f"has a pose ({pose}) and one camera ({matrix_name}); expected "
                               "depth, color and depth_to_color in JSON")
    matrix = _numbers(fields[matrix_name], matrix_name)
    if len(matrix) != _MATRIX_NUMBERS:
        raise CalibrationError(f"{matrix_name} has {len(matrix)} numbers, expected 9")
    if matrix_name == _COLUMN_BY_COLUMN:
        matrix = [matrix[column * 3 + row] for row in range(3) for column in range(3)]
    fx, skew, cx, zero, fy, cy, *last = matrix
    if skew or zero or last != [0, 0, 1]:
        raise CalibrationError(f"{matrix_name} is {matrix}, expected fx 0 cx, 0 fy cy, 0 0 1")
    model = "fisheye" if fields.get(_FISHEYE) else str(fields.get("distortion_model") or "").lower()
    if model not in _MODELS:
        raise CalibrationError(f"distortion_model is {model!r}, expected plumb_bob or "
                               "rational_polynomial")
    width, height = (_size(fields, names) for names in (_WIDTH, _HEIGHT))
    camera = CameraModel(width=width, height=height, fx=fx, fy=fy, cx=cx, cy=cy)
    name = _named(fields, _DISTORTION)
    return camera_with_distortion(camera, _numbers(fields[name], name)) if name else camera


def _value(node: Any) -> Any:
    if node.isMap():
        data = node.getNode("data")
        return _value(data) if not data.empty() else None
    if node.isSeq():
        if node.size() > _MOST_NUMBERS:
            raise CalibrationError(f"has a list of {node.size()} values, at most {_MOST_NUMBERS}")
        return [node.at(index).real() for index in range(node.size())]
    if node.isInt() or node.isReal():
        return node.real()
    return node.string() if node.isString() else None


def _named(fields: Fields, names: Sequence[str]) -> str:
    return next((name for name in names if fields.get(name) is not None), "")


def _required(fields: Fields, names: Sequence[str]) -> str:
    name = _named(fields, names)
    if not name:
        has = ", ".join(list(fields)[:8]) or "nothing"
        raise CalibrationError(f"{names[0]} is missing, found {has}")
    return name


def _size(fields: Fields, names: Sequence[str]) -> int:
    name = _required(fields, names)
    number, = _numbers([fields[name]], name)
    if number != int(number):
        raise CalibrationError(f"{name} is {number}, expected whole pixels")
    return int(number)


def _numbers(value: Any, name: str) -> list[float]:
    """Give the numbers of a list, or of a list of lists."""
    if isinstance(value, Mapping):
        value = value.get("data")
    flat: list[Any] = ([number for row in value for number in
                        (row if isinstance(row, list) else [row])]
                       if isinstance(value, list) else [None])
    if len(flat) > _MOST_NUMBERS or not all(
            isinstance(number, int | float) and not isinstance(number, bool)
            and abs(number) < float("inf") for number in flat):
        raise CalibrationError(f"{name} is {json.dumps(value)[:60]}, expected finite numbers")
    return [float(number) for number in flat]
