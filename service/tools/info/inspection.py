"""A file is known by how it begins; it comes from outside and is not believed."""

import json
import os
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

from denseface.capture.errors import CaptureError
from denseface.files import open_regular
from denseface.service.errors import FormatError, reason_of

__all__ = ["Info", "inspect"]

Info = dict[str, Any]
"""What is known of a file, by name, in the order in which it is told; JSON can hold it."""
_BEGINNING = 4096
"""Bytes that tell what a file is."""


def inspect(path: Path) -> Info:
    """Say what a file is.

    Always there are `path`, `kind`, `format` and `bytes`; lengths are in millimetres and end in
    `_mm`. Files of more than 256 MiB are refused, recordings excepted.

    Raises
    ------
    FormatError, CaptureError
        It is missing, damaged, or nothing that is known: one line that names it.
    """
    try:
        with open_regular(path) as file:
            beginning = file.read(_BEGINNING)
            size = os.fstat(file.fileno()).st_size
    except OSError as error:
        raise FormatError(f"{path}: {reason_of(error)}") from error
    if not size:
        raise FormatError(f"{path}: is empty")
    look = _looker(path, beginning)
    try:
        found = look(path)
    except (FormatError, CaptureError):
        raise
    except OSError as error:
        raise FormatError(f"{path}: {reason_of(error)}") from error
    except (ValueError, LookupError, TypeError, RecursionError, OverflowError, struct.error,
            AttributeError) as error:
        said = " ".join(str(error).split())[:200]
        raise FormatError(f"{path}: damaged ({said or type(error).__name__})") from error
    return {"path": str(path), "kind": found.pop("kind"), "format": found.pop("format"),
            "bytes": size, **found}


def _looker(path: Path, beginning: bytes) -> Callable[[Path], Info]:
    """Give what looks into a file that begins so; FormatError where nothing does."""
    from denseface.service.tools.info import captured, models, packed, pictures

    for magic, look in ((b"ply\n", models.of_ply), (b"ply\r", models.of_ply),
                        (b"# .PCD", models.of_pcd), (b"glTF", models.of_glb),
                        (b"NI10", captured.of_recording), (b"DFGR", captured.of_face_grid),
                        (b"PK\3\4", packed.of_zip), (b"\x89PNG\r\n\x1a\n", pictures.of_png)):
        if beginning.startswith(magic):
            return look
    if beginning[:4] == b"RIFF" and beginning[8:12] == b"WEBP":
        return pictures.of_webp
    if beginning[4:8] == b"ftyp":
        return pictures.of_mp4
    text = beginning.lstrip(b"\xef\xbb\xbf \t\r\n")
    if text.startswith(b"{") and b'"dense_points"' in beginning:
        return captured.of_report
    if text.startswith((b"{", b"%YAML", b"<?xml", b"image_width", b"camera_")):
        return captured.of_calibration
    if path.suffix.lower() == ".stl":
        return models.of_stl
    if path.suffix.lower() == ".obj" or text.startswith(b"# by denseface"):
        return models.of_obj
    if path.suffix.lower() in (".yaml", ".yml", ".json", ".xml"):
        return captured.of_calibration
    raise FormatError(
        f"{path}: nothing that is known here: expected a face (.npz .ply .pcd .obj .glb .stl .3mf "
        f".png .webp .mp4 .face), a frame (.npz), a recording (.oni), a calibration or a report; "
        f"it begins with {_shown(beginning)}")


def _shown(beginning: bytes) -> str:
    return json.dumps(beginning[:8].decode("latin-1"))
