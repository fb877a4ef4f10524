"""Which calibration wins, and how its file is read."""

import codecs
import json
from pathlib import Path
from typing import Any

from denseface.arguments import as_path
from denseface.capture.calibration import Calibration, CameraModel, ChosenCalibration
from denseface.capture.calibration_files._distortion import camera_with_distortion
from denseface.capture.calibration_files._formats import one_camera, parse_storage
from denseface.capture.errors import CalibrationError
from denseface.files import read_bounded

__all__ = ["choose_calibration", "load_calibration", "read_calibration"]

_MAX_FILE_BYTES = 2**20
"""Of a calibration file; a thousand times what one has."""
_OF_ONE = frozenset({"intrinsic_matrix", "camera_matrix", "K"})
"""Names by which JSON of one camera is known."""
_OUR_DISTORTION = 5
"""Coefficients of a camera of ours."""


def choose_calibration(
    path: Path | None, argument: Calibration | str | Path | None
) -> ChosenCalibration | None:
    """Take the argument, else ``NAME.calibration.json`` beside the file, else none.

    Raises
    ------
    CalibrationError
        The chosen file cannot be read.
    """
    if isinstance(argument, Calibration):
        return ChosenCalibration(argument, "argument")
    if argument is not None:
        return read_calibration(argument)._replace(origin=f"argument {Path(argument).name}")
    beside = path and path.with_name(f"{path.stem}.calibration.json")
    if beside and beside.exists():
        return read_calibration(beside)._replace(origin=f"beside: {beside.name}")
    return None


def load_calibration(path: str | Path) -> Calibration:
    """Read a calibration file: this project's JSON, OpenCV's, ROS's or Open3D's.

    What describes one camera is taken for both. `open_source(uri, path)` takes such a file too.

    Raises
    ------
    CalibrationError
        One line that names the file, what was found and what was expected.
    """
    return read_calibration(as_path(path)).calibration


def read_calibration(path: str | Path) -> ChosenCalibration:
    """Read a calibration file, ours or another program's.

    Known are this project's JSON; OpenCV's YAML and XML with `camera_matrix` and
    `distortion_coefficients`; ROS's `camera_info` YAML; Open3D's JSON of an intrinsic matrix. All
    but the first describe one camera: it is taken for both, with a note. The first may also have
    `registered`: whether the depth is already in the colour camera's pixels.

    Raises
    ------
    CalibrationError
        One line that names the file, what was found and what was expected.
    """
    try:
        text = _decoded(read_bounded(path, _MAX_FILE_BYTES))
    except OSError as error:
        raise CalibrationError(f"{path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise CalibrationError(f"{path}: not a text (byte {error.start})") from error
    if not text.lstrip().startswith(("{", "[")):
        return _of_one(path, parse_storage, text)
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise CalibrationError(f"{path}: not JSON: {error}") from error
    if not isinstance(fields, dict) or not {"depth", "color"} & fields.keys():
        if not isinstance(fields, dict) or not _OF_ONE & fields.keys():
            return ChosenCalibration(Calibration.from_json(text, name=str(path)), str(path))
        return _of_one(path, lambda _: fields, text)
    registered = fields.pop("registered", None)
    if not isinstance(registered, bool | None):
        raise CalibrationError(f"{path}: registered: expected true or false, found "
                               f"{json.dumps(registered)[:40]}")
    for name in ("depth", "color"):
        fields[name] = _with_five(fields[name], f"{path}: {name}") if name in fields else None
    text = json.dumps({name: value for name, value in fields.items() if value is not None})
    return ChosenCalibration(Calibration.from_json(text, name=str(path)), str(path),
                             registered=registered)


def _of_one(path: str | Path, parse: Any, text: str) -> ChosenCalibration:
    try:
        camera = one_camera(parse(text))
    except CalibrationError as error:
        raise CalibrationError(f"{path}: {error}") from error
    return ChosenCalibration(
        Calibration(depth=camera, color=camera), str(path),
        (f"{Path(path).name} describes one camera, which is taken for depth and colour alike: "
         "right where the depth is registered to the colour",))


def _with_five(camera: Any, name: str) -> Any:
    """Give a camera of our JSON whose distortion has 4 or 8 coefficients the five that we have."""
    given = camera.get("distortion") if isinstance(camera, dict) else None
    if (not isinstance(given, list) or len(given) == _OUR_DISTORTION
            or not all(isinstance(value, int | float) for value in given)):
        return camera
    plain = {key: value for key, value in camera.items() if key != "distortion"}
    try:
        model = CameraModel.model_validate(plain)
    except ValueError:
        return camera  # is refused, with the name of the field, by who reads the whole
    try:
        return camera_with_distortion(model, given).model_dump()
    except CalibrationError as error:
        raise CalibrationError(f"{name}: {error}") from error


def _decoded(data: bytes) -> str:
    """Decode UTF-8, or UTF-16 where it says so (PowerShell's `>`); leaves the mark out."""
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return data.decode("utf-16")
    return data.decode("utf-8-sig")
