"""Clouds and meshes: what their headers say of the face, and what is in them."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.files import open_regular
from denseface.service.export.provenance import PRINTED
from denseface.service.export.reading import read_mesh
from denseface.service.tools.info.inspection import Info

__all__ = ["CAMERA", "PRINTER", "box", "closed", "of_glb", "of_obj", "of_pcd", "of_ply", "of_stl",
           "printable", "refuse_document_type"]

CAMERA, PRINTER = ("the depth camera's: x right, y down, z forward",
                   "the printer's: x right, y back, z up from the bed")
_HEADER_BYTES = 1 << 16
_COMMENT = re.compile(r"(?:denseface\.)?([a-z_]+):? (.*)")
_OURS = ("by denseface", "generator denseface", "denseface.generator")
"""How a line of our own files begins."""


def of_ply(path: Path) -> Info:
    """Look into a `.ply`."""
    header = _text(path).partition("end_header")[0].splitlines()
    kind = next((line.split()[1:2] for line in header if line.startswith("format ")), ["?"])[0]
    fields = [line.split()[-1] for line in header if line.startswith("property ")
              and "list" not in line]
    told = [line.partition(" ")[2] for line in header if line.startswith("comment ")]
    return _model(path, f"PLY, {kind.replace('_', ' ')}", told, fields=fields)


def of_pcd(path: Path) -> Info:
    """Look into a `.pcd`."""
    lines = _text(path).partition("\nDATA ")
    header = lines[0].splitlines()
    told = [line[1:].strip() for line in header if line.startswith("#")]
    fields = next((line.split()[1:] for line in header if line.startswith("FIELDS ")), [])
    return _model(path, f"PCD, {lines[2].split(maxsplit=1)[0] if lines[2].strip() else '?'}", told,
                  fields=fields)


def of_obj(path: Path) -> Info:
    """Look into an `.obj`."""
    told = []
    for line in _text(path).splitlines():
        if not line.startswith("#"):
            break
        told.append(line[1:].strip())
    return _model(path, "Wavefront OBJ", told)


def of_stl(path: Path) -> Info:
    """Look into an `.stl`: what is ours and stands on the bed is a solid for printing."""
    header = _text(path)[:80].partition("\0")[0].rstrip()
    found = _model(path, "STL", [])
    if header and not header.startswith("solid"):
        found["header"] = printable(header)
    if header.startswith(PRINTED):
        found |= {"kind": "solid for 3D printing", "frame": PRINTER} | _on_bed(found)
    elif header.startswith(_OURS):
        found["frame"] = CAMERA
    return found


def _on_bed(found: Info) -> Info:
    """Give the place of a solid as it is printed, which `read_mesh` gives in a camera's frame."""
    x, y, z = zip(found["lowest_mm"], found["highest_mm"], strict=True)
    return {"lowest_mm": [x[0], 0.0 - y[1], 0.0 - z[1]],
            "highest_mm": [x[1], 0.0 - y[0], 0.0 - z[0]]}


def of_glb(path: Path) -> Info:
    """Look into a `.glb`; what is told of it is in millimetres and the camera's frame."""
    with open_regular(path) as file:
        head = file.read(20)
        document = json.loads(file.read(min(int.from_bytes(head[12:16], "little"), 1 << 24)))
    asset, named = document["asset"], "glTF 2.0, binary: metres, y up"
    if "EXT_meshopt_compression" in document.get("extensionsRequired", []):
        found = _announced(document, named)
    else:
        found = _model(path, named, []) | {"frame": CAMERA}
    extras = asset.get("extras")
    told = {"generator": asset.get("generator"), **(extras if isinstance(extras, dict) else {})}
    for name in ("copyright", "generator"):
        if isinstance(asset.get(name), str):
            told[name] = asset[name]
    if used := document.get("extensionsUsed"):
        found["extensions"] = [str(one) for one in used][:20]
    found["textured"] = bool(document.get("textures"))
    found["provenance"] = {name: printable(str(text)) for name, text in told.items() if text}
    return found


def _announced(document: dict[str, Any], named: str) -> Info:
    """Give what the document of a compressed mesh says of it."""
    (mesh,) = document["meshes"]
    primitive = mesh["primitives"][0]
    positions = document["accessors"][primitive["attributes"]["POSITION"]]
    corners = document["accessors"][primitive["indices"]]
    return {"kind": "mesh", "format": named, "points": int(positions["count"]),
            "triangles": int(corners["count"]) // 3, "frame": CAMERA}


def _model(path: Path, named: str, told: list[str], **more: Any) -> Info:
    mesh = read_mesh(path)
    found: Info = {"kind": "cloud" if mesh.triangles is None else "mesh", "format": named,
                   "points": len(mesh.points)}
    if mesh.triangles is not None:
        found |= {"triangles": len(mesh.triangles), "closed": closed(mesh.triangles)}
    found |= {"colors": mesh.colors is not None, **more, **box(mesh.points), "frame": CAMERA,
              "provenance": _provenance(told)}
    if not found["provenance"]:
        found["frame"] = "not said"
    return found


def closed(triangles: NDArray[np.integer]) -> bool:
    """Say whether each edge has two triangles that run along it in opposite directions."""
    a, b = triangles.astype(np.int64), np.roll(triangles, -1, axis=1).astype(np.int64)
    count = int(triangles.max()) + 1
    ways = np.sort((a * count + b).ravel())
    return (not (ways[1:] == ways[:-1]).any()
            and np.array_equal(ways, np.sort((b * count + a).ravel())))


def box(points: NDArray[np.floating]) -> Info:
    """Give how large points are, and where."""
    low, high = points.min(axis=0).astype(float), points.max(axis=0).astype(float)
    return {"size_mm": _rounded(high - low), "lowest_mm": _rounded(low),
            "highest_mm": _rounded(high)}


def _rounded(values: NDArray[np.float64]) -> list[float]:
    return [round(float(value), 2) for value in values]


def _text(path: Path) -> str:
    with open_regular(path) as file:
        return file.read(_HEADER_BYTES).decode("latin-1")


def _provenance(told: list[str]) -> dict[str, str]:
    """Give what comments of our own files tell of the face's making."""
    if not any(line.startswith(_OURS) for line in told):
        return {}
    found: dict[str, str] = {}
    for line in told:
        if (match := _COMMENT.fullmatch(line)) and match[1] != "by":
            found.setdefault(match[1], printable(match[2]))
    return found


def printable(text: str) -> str:
    """Give a text from a file as one that a terminal can show."""
    return "".join(one if one.isprintable() else " " for one in text)[:4096]


def refuse_document_type(*_: object) -> None:
    """Raise ValueError at the document type of an XML: its entities may unfold without end."""
    raise ValueError("it has a document type, which no such file has")
