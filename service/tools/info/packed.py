"""Zips: a face or a frame in a `.npz`, a solid in a `.3mf`."""

import zipfile
import zlib
from array import array
from pathlib import Path
from xml.parsers.expat import ExpatError, ParserCreate

import numpy as np

from denseface.capture.npz import load_frame
from denseface.files import open_regular
from denseface.recon.face import Face, Report
from denseface.service.errors import FormatError
from denseface.service.export import load_face
from denseface.service.export.printing.threemf import MODEL
from denseface.service.export.provenance import frame_provenance, provenance
from denseface.service.tools.info.inspection import Info
from denseface.service.tools.info.models import (
    CAMERA,
    PRINTER,
    box,
    closed,
    printable,
    refuse_document_type,
)

__all__ = ["of_zip", "report_lines"]

_MAX_MODEL_BYTES = 2**28
"""Of a 3MF's XML."""
_CHUNK = 1 << 20
_FIRST_MEMBERS = 64


def of_zip(path: Path) -> Info:
    """Look into a `.npz` or a `.3mf`."""
    try:
        with open_regular(path) as file, zipfile.ZipFile(file) as archive:
            names = {member.filename for member in archive.infolist()[:_FIRST_MEMBERS]}
            if MODEL in names:
                return _of_3mf(path, archive)
    except (zipfile.BadZipFile, zlib.error, EOFError, NotImplementedError, RuntimeError,
            ExpatError) as error:
        raise FormatError(f"{path}: damaged, or cut short ({error})") from error
    if "initial_points.npy" in names or "dense_points.npy" in names:
        return _of_face(load_face(path))
    if "depth.npy" in names:
        return _of_frame(path)
    raise FormatError(f"{path}: a zip archive that is no face, frame or .3mf; it holds "
                      f"{', '.join(sorted(names))[:100] or 'nothing'}")


def _of_face(face: Face) -> Info:
    dense = face.dense
    return {"kind": "face", "format": "NumPy .npz, whole: denseface.load_face reads it",
            "points": len(dense), "measured_points": len(face.initial), "colors": True,
            "grid": list(dense.grid_shape), "step_mm": round(dense.grid_step_mm, 4),
            "sigma_mm": round(float(np.median(dense.sigma)), 3) if len(dense) else None,
            **(box(dense.points) if len(dense) else {}), "frame": CAMERA,
            **report_lines(face.report), "provenance": provenance(face.report)}


def report_lines(report: Report) -> Info:
    """Give what a `Report` says beside where the face comes from."""
    found: Info = {"noise_mm": round(report.noise_mm, 3), "fused": report.fused,
                   "warnings": list(report.warnings)}
    if report.face_score is not None:
        found["face_score"] = round(report.face_score, 3)
    if report.consent:
        found["consent"] = report.consent.model_dump(mode="json")
    return found


def _of_frame(path: Path) -> Info:
    frame = load_frame(path)
    rows, columns = frame.depth.shape
    read = frame.depth[frame.depth > 0] * (frame.depth_meaning.unit_um / 1000)
    found: Info = {
        "kind": "frame", "format": "NumPy .npz: denseface.load_frame reads it",
        "depth": f"{columns}x{rows}", "measured": round(len(read) / frame.depth.size, 4),
        "color": None if frame.color is None else "{1}x{0}".format(*frame.color.shape),
        "registered": bool(frame.registered), "depth_unit_um": frame.depth_meaning.unit_um,
        "depth_timestamp_us": frame.depth_timestamp_us,
        "color_timestamp_us": frame.color_timestamp_us}
    if len(read):
        found |= {"nearest_mm": float(read.min()), "farthest_mm": float(read.max())}
    told = frame_provenance(frame)
    told.pop("generator", None)  # which is this program; who wrote the file is not known
    return found | {"notes": list(frame.origin.notes), "provenance": told}


def _of_3mf(path: Path, archive: zipfile.ZipFile) -> Info:
    """Read the model as a stream: neither its text nor its tree is ever in memory whole."""
    model = _Model()
    with archive.open(MODEL) as file:
        left = _MAX_MODEL_BYTES
        while chunk := file.read(min(_CHUNK, left + 1)):
            left -= len(chunk)
            if left < 0:
                raise FormatError(f"{path}: its model has more than {_MAX_MODEL_BYTES} bytes")
            model.feed(chunk)
    return model.found()


class _Model:
    """What there is in a 3MF's model; ValueError or ExpatError where that is no model."""

    def __init__(self) -> None:
        self._parser = ParserCreate()
        self._parser.StartElementHandler = self._begin
        self._parser.EndElementHandler = self._end
        self._parser.CharacterDataHandler = self._text
        self._parser.StartDoctypeDeclHandler = refuse_document_type
        self._points, self._triangles = array("d"), array("q")
        self._metadata: dict[str, str] = {}
        self._name = ""
        """Of the piece of metadata that is being read."""
        self._colors, self._unit, self._objects = 0, "", 0

    def feed(self, chunk: bytes) -> None:
        self._parser.Parse(chunk)

    def _begin(self, name: str, given: dict[str, str]) -> None:
        kind, self._name = name.rpartition(":")[2], ""
        if kind == "vertex":
            self._points.extend(float(given[one]) for one in "xyz")
        elif kind == "triangle":
            self._triangles.extend(int(given[one]) for one in ("v1", "v2", "v3"))
        elif kind == "color":
            self._colors += 1
        elif kind == "metadata" and len(self._metadata) < _FIRST_MEMBERS:
            self._name = given.get("name", "")[:100]
        elif kind == "model":
            self._unit = given.get("unit", "millimeter")[:20]
        elif kind == "object":
            self._objects += 1

    def _end(self, _: str) -> None:
        self._name = ""

    def _text(self, text: str) -> None:
        if self._name:
            self._metadata[self._name] = printable(self._metadata.get(self._name, "") + text)

    def found(self) -> Info:
        """Give what there was."""
        self._parser.Parse(b"", True)
        points = np.array(self._points).reshape(-1, 3)
        triangles = np.array(self._triangles).reshape(-1, 3)
        if not len(triangles) or not len(points) or not np.isfinite(points).all():
            raise ValueError("its model has no triangles")
        found: Info = {"kind": "solid for 3D printing", "format": "3MF", "unit": self._unit,
                       "points": len(points), "triangles": len(triangles)}
        if self._objects == 1:  # else numbers of points are each object's own
            if not 0 <= triangles.min() <= triangles.max() < len(points):
                raise ValueError("a triangle names a point that is not there")
            found["closed"] = closed(triangles)
        told = {name.rpartition(":")[2]: text for name, text in self._metadata.items()}
        told.pop("Title", None)
        if "Application" in told:
            told = {"generator": told.pop("Application"), **told}
        sides = box(points) if self._unit == "millimeter" else {}
        return found | {"colors": self._colors > 0, **sides, "frame": PRINTER, "provenance": told}
