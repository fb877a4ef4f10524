"""What is around a face: recordings, calibrations, reports, and faces for browsers."""

import json
import math
import struct
from pathlib import Path

from pydantic import ValidationError

from denseface.capture.calibration import CameraModel
from denseface.capture.calibration_files import read_calibration
from denseface.capture.oni.recorded import Recorded
from denseface.files import open_regular, read_bounded
from denseface.recon.face import Report
from denseface.service.errors import FormatError, first_error
from denseface.service.export.provenance import provenance
from denseface.service.tools.info.inspection import Info
from denseface.service.tools.info.models import CAMERA
from denseface.service.tools.info.packed import report_lines

__all__ = ["of_calibration", "of_face_grid", "of_recording", "of_report"]

_MAX_REPORT_BYTES = 1 << 22
_MAX_GRID_HEADER = 4096


def of_recording(path: Path) -> Info:
    """Look into an `.oni`."""
    recorded = Recorded(path)
    stamps = recorded.file.stamps_us
    first = recorded.origin(stamps[0] if stamps else 0, 0)
    found: Info = {
        "kind": "recording", "format": "OpenNI2 .oni", "frames": recorded.pairs,
        "seconds": round((max(stamps) - min(stamps)) / 1e6, 3) if stamps else 0.0,
        "depth": _sides(recorded.depth.sides), "depth_frames": recorded.depth.frames}
    if recorded.color:
        found |= {"color": _sides(recorded.color.sides), "color_frames": recorded.color.frames}
    else:
        found["color"] = None
    calibration = recorded.calibration
    told = {"captured_at": first.captured_at, "sensor": first.sensor,
            "calibration": calibration.origin if calibration else ""}
    return found | {"registered": recorded.depth.registered, "notes": list(recorded.notes),
                    "provenance": {name: text for name, text in told.items() if text}}


def _sides(sides: tuple[int, int] | None) -> str | None:
    return "{}x{}".format(*sides) if sides else None


def of_calibration(path: Path) -> Info:
    """Look into a calibration file, ours or another program's."""
    chosen = read_calibration(path)
    calibration = chosen.calibration
    return {"kind": "calibration", "format": path.suffix.lower().lstrip(".").upper() or "text",
            "depth_camera": _camera(calibration.depth), "color_camera": _camera(calibration.color),
            "baseline_mm": round(math.hypot(*calibration.depth_to_color.translation_mm), 3),
            "registered": chosen.registered, "notes": list(chosen.notes)}


def _camera(camera: CameraModel) -> str:
    return (f"{camera.width}x{camera.height}, fx {camera.fx:.2f}, fy {camera.fy:.2f}, cx "
            f"{camera.cx:.2f}, cy {camera.cy:.2f} pixels")


def of_report(path: Path) -> Info:
    """Look into a report that `--report` wrote."""
    try:
        report = Report.model_validate_json(read_bounded(path, _MAX_REPORT_BYTES))
    except ValidationError as error:
        field, message = first_error(error)
        raise FormatError(f"{path}: {field}: {message}") from error
    return {"kind": "report", "format": "JSON", "points": report.dense_points,
            "measured_points": report.initial_points, **report_lines(report),
            "total_ms": round(report.timings_ms.get("total", 0.0), 1),
            "provenance": provenance(report)}


def of_face_grid(path: Path) -> Info:
    """Look into a face for browsers, as docs/wire.md describes it: its header."""
    with open_regular(path) as file:
        _, version, length = struct.unpack("<4sII", file.read(12))
        header = json.loads(file.read(length)) if length <= _MAX_GRID_HEADER else None
    if version != 1 or not isinstance(header, dict):
        raise FormatError(f"{path}: version {version} with a header of {length} bytes, expected "
                          f"version 1 and at most {_MAX_GRID_HEADER}")
    rows, columns = int(header["rows"]), int(header["columns"])
    step = float(header["step_mm"])
    return {"kind": "face for browsers", "format": "DFGR 1", "points": int(header["points"]),
            "measured_points": int(header["seeds"]), "colors": True, "grid": [rows, columns],
            "step_mm": round(step, 4),
            "size_mm": [round((side - 1) * step, 2) for side in (columns, rows)],
            "sigma_mm": [round(float(one), 3) for one in header["sigma_mm"]], "frame": CAMERA}
