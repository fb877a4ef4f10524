"""What is said of the files that were written: what each is, its size, and what opens it."""

from pathlib import Path
from typing import TYPE_CHECKING

from denseface.service.export.files import FaceFiles
from denseface.service.export.options import ExportOptions
from denseface.service.export.printing.choice import ENDINGS as PRINTED

if TYPE_CHECKING:
    from denseface.recon.face import Face

__all__ = ["NOTHING_WRITTEN", "WrittenFiles", "describe", "describe_file"]

NOTHING_WRITTEN = ("nothing was written: -o writes the face, --preview a picture of it, --report "
                   "the report")

_VIEWERS = {
    ".ply": "MeshLab, CloudCompare and Blender open it",
    ".pcd": "CloudCompare and the Point Cloud Library open it",
    ".npz": "load_face() of denseface reads it, and so does numpy.load()",
    ".obj": "MeshLab and Blender open it",
    ".glb": "Blender, MeshLab and Windows 3D Viewer open it",
    ".stl": "slicers for 3D printing, MeshLab and Blender open it",
    ".3mf": "slicers for 3D printing and Windows 3D Viewer open it, in colour",
    ".webp": "any browser shows it",
    ".mp4": "browsers and video players show it",
    ".png": "any browser or image viewer opens it",
    ".json": "",
    ".csv": "any spreadsheet opens it",
}
"""By a file's ending, where it is known: with what to look at it."""
_MESHES = {".obj", ".glb", ".stl"}
_PICTURES = {".png": "picture of the face", ".webp": "the face, turning to and fro",
             ".mp4": "the face, turning to and fro"}
_SOLIDS = {"plate": "relief on a plate", "mask": "hollow mask"}
_COMPACT = "pages with three.js or Babylon.js open it, few other programs do"
_BESIDE = {".mtl": "its material", ".jpg": "its texture"}


def describe(files: FaceFiles, face: "Face") -> list[str]:
    """Say of each file of a face what it is, a line each; nothing where nothing was asked for."""
    lines = []
    if files.output:
        lines.append(describe_file(files.output, _what(files.output, files.options, face),
                                   compact=files.options.compact))
    lines += [describe_file(path, _BESIDE.get(path.suffix.lower(), "")) for path in files.beside]
    if files.report:
        lines.append(describe_file(files.report, "report"))
    if files.rendering:
        lines.append(describe_file(files.rendering, "picture of the face"))
    return lines


def _what(path: Path, options: ExportOptions, face: "Face") -> str:
    ending, solid = path.suffix.lower(), options.printing.solid
    if ending in _PICTURES:
        return _PICTURES[ending]
    if ending in PRINTED and solid != "open":
        import numpy as np

        height = options.printing.height_mm
        rows = np.ptp(face.dense.points[:, 1]) if len(face.dense) else 0.0
        return (f"{_SOLIDS[solid]}, the face {height or rows:.0f} mm high"
                + ("" if height else ", life size"))
    if ending in _MESHES:
        from denseface.service.export.mesh import face_mesh

        return f"mesh of {len(face_mesh(face.dense, options).points):,} points"
    return f"{len(face.dense):,} points"


class WrittenFiles:
    """What was written of many faces, by folder and kind."""

    def __init__(self) -> None:
        self._kinds: dict[tuple[Path, str], tuple[int, int, Path]] = {}

    def add(self, *paths: Path | None) -> None:
        """Count files that were written; None is none."""
        for path in filter(None, paths):
            kind = path.parent, path.suffix.lower()
            count, size, _ = self._kinds.get(kind, (0, 0, path))
            self._kinds[kind] = count + 1, size + path.stat().st_size, path

    def lines(self) -> list[str]:
        """Say what there is, a line for each kind."""
        return [f"{path}: {_in_words(size)}{_viewers(ending)}" if count == 1 else
                f"{folder}/: {count} {ending}, {_in_words(size)}{_viewers(ending)}"
                for (folder, ending), (count, size, path) in self._kinds.items()]


def describe_file(path: Path, what: str, *, compact: bool = False) -> str:
    """Say of a file that was written what it is, its size, and what opens it."""
    opened = f"; {_COMPACT}" if compact else _viewers(path.suffix.lower())
    return f"{path}: {what}, {_in_words(path.stat().st_size)}{opened}"


def _viewers(ending: str) -> str:
    return f"; {viewers}" if (viewers := _VIEWERS.get(ending)) else ""


def _in_words(size: float) -> str:
    for unit in ("bytes", "kB", "MB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "bytes" or size >= 100 else f"{size:.1f} {unit}"
        size /= 1000
    return f"{size:.1f} GB"
