"""The true surface of a face, from a mesh of anybody: its unit, its frame, distances from it."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import Face
from denseface.service.errors import UsageError
from denseface.service.export.reading import read_mesh
from denseface.service.tools.comparison.alignment import align
from denseface.service.tools.comparison.regions import HeadPlace, foremost
from denseface.service.tools.comparison.surface import Pose, Surface

__all__ = ["ALIGNMENTS", "UNITS", "Laid", "Truth"]

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0}
"""Millimetres of each unit that a mesh may be in."""
ALIGNMENTS = ("auto", "always", "none")
_HEAD_MM = (80.0, 800.0)
"""The largest side of what is scanned of a head: of a nose and eyes at least, of head and
shoulders at most."""
_THERE_MM = 5.0
"""A truth whose median distance from the measured points is less is in their frame already."""
_SEEN_AT_MM = 700.0
"""For the search of a face in it, a truth is put so far before a camera."""
_SURE = 0.5
"""Score below which there is no face in it."""
_OVERLAP = 0.6
"""Share of the face that a truth must meet."""
_FITS_MM, _MISFIT_MM = 1.2, 3.0
"""What an alignment leaves, root mean square: with less no other turn is tried, with more the truth
is of another head."""


class Laid(NamedTuple):
    """How a truth lies on a face."""

    pose: Pose
    """From the truth's frame, in mm, to the face's."""
    moved: bool
    """Whether it was aligned, or taken as it stands."""
    rms_mm: float
    """Root mean square of what the alignment leaves; 0 where there was none."""


@dataclass(frozen=True, eq=False)
class Truth:
    """A true surface.

    Attributes
    ----------
    name : of its file
    points : (n, 3) float64, mm
    triangles : (t, 3) int32
    unit : that the file was taken to be in: of `UNITS`
    """

    name: str
    points: NDArray[np.float64]
    triangles: NDArray[np.int32]
    unit: str

    @classmethod
    def read(cls, path: Path, unit: str = "auto") -> Self:
        """Read a mesh, `.ply` `.obj` `.stl` `.glb` or a face's `.npz`.

        unit : of `UNITS`, or `auto` for the one in which it is as large as a head

        Raises
        ------
        FormatError
            The file cannot be read.
        UsageError
            It has no triangles, or no unit makes a head of it.
        """
        mesh = read_mesh(path)
        if mesh.triangles is None:
            raise UsageError(f"{path}: has points alone, expected a mesh with triangles")
        points = mesh.points.astype(np.float64)
        used = points[np.unique(mesh.triangles)]
        largest = float(np.ptp(used, axis=0).max())
        if unit == "auto":
            fitting = [name for name, mm in UNITS.items()
                       if _HEAD_MM[0] <= mm * largest <= _HEAD_MM[1]]
            if not fitting:
                raise UsageError(f"{path}: is {largest:.4g} units long, which is no head in mm, cm "
                                 "or m: --unit says which it is")
            unit = fitting[0]
        return cls(str(path), UNITS[unit] * points, mesh.triangles, unit)

    def lay_on(self, face: Face, name: str, how: str = "auto") -> Laid:
        """Find where it lies on a face.

        how : `none` for as it stands; `auto` to align it where it is elsewhere; `always`

        Raises
        ------
        UsageError
            There is no face in it, or it does not fit.
        """
        none = Laid(Pose.none(), moved=False, rms_mm=0.0)
        if how == "none":
            return none
        surface = Surface.of_face(face)
        near = float(np.median(self.distances(surface.points, none)))
        if how == "auto" and near < _THERE_MM:
            return none
        own = Surface.of_mesh(self.points, self.triangles)
        best: Laid | None = None
        starts = 0
        for start in [Pose.none()] if near < _THERE_MM else self._starts(own, surface):
            starts += 1
            laid = align(surface.moved(start.inverse), _outward(own, start), place=None,
                         start=Pose.none())
            if laid is None or laid.overlap < _OVERLAP:
                continue
            if best is None or laid.rms_mm < best.rms_mm:
                best = Laid(start @ laid.pose.inverse, moved=True, rms_mm=laid.rms_mm)
            if best.rms_mm < _FITS_MM:
                break
        if not starts:
            raise UsageError(f"{self.name}: no face is found in it to lay on that of {name}: "
                             "--align none takes it as it stands")
        if best is None or best.rms_mm > _MISFIT_MM:
            raise UsageError(f"{self.name}: does not lie on the face of {name}: is it the same "
                             "head, is --unit right? --align none takes it as it stands")
        return best

    def _starts(self, own: Surface, surface: Surface) -> Iterator[Pose]:
        """Find the face in it, whichever way is up in its frame, and lay it on another."""
        head = HeadPlace.find(surface)
        middle = own.points.mean(axis=0)
        for turn in _turns():
            shown = Pose(turn, np.array([0, 0, _SEEN_AT_MM]) - turn @ middle)
            place = HeadPlace.find(own.moved(shown))
            if head is not None and place is not None and place.score >= _SURE:
                yield head.pose @ place.pose.inverse @ shown

    def distances(self, points: NDArray[np.floating], laid: Laid) -> NDArray[np.float64]:
        """Measure how far points, (n, 3) mm in the face's frame, are from the surface, mm."""
        o3d = _open3d()
        # In its own frame, and near its middle: the library computes with 32 bits.
        middle = self.points.mean(axis=0)
        scene = o3d.t.geometry.RaycastingScene()
        scene.add_triangles(
            o3d.core.Tensor(np.ascontiguousarray(self.points - middle, np.float32)),
            o3d.core.Tensor(np.ascontiguousarray(self.triangles, np.uint32)))
        inside = laid.pose.inverse.of(points) - middle
        found = scene.compute_distance(o3d.core.Tensor(inside.astype(np.float32)))
        return np.asarray(found.numpy(), np.float64)


def _outward(own: Surface, start: Pose) -> Surface:
    """Turn normals round where a file's triangles are wound the other way.

    start : to the frame of a camera that sees it
    """
    seen = own.moved(start)
    rows = foremost(seen.points)
    inward = (seen.points[rows] * seen.normals[rows]).sum(axis=1) > 0
    return Surface(own.points, -own.normals, own.sigma) if inward.mean() > 0.5 else own


def _turns() -> list[NDArray[np.float64]]:
    """Give the 24 turns that take axes to axes, those first that files mostly need."""
    common = [np.diag([1.0, 1.0, 1.0]), np.diag([1.0, -1.0, -1.0])]
    found = list(common)
    for a in np.eye(3):
        for b in np.eye(3):
            if a @ b == 0:
                for s in (1.0, -1.0):
                    for t in (1.0, -1.0):
                        turn = np.stack([s * a, t * b, np.cross(s * a, t * b)])
                        if not any(np.allclose(turn, one) for one in found):
                            found.append(turn)
    return found


def _open3d() -> Any:
    try:
        import open3d as o3d
    except ImportError as error:
        raise UsageError("distances from a mesh need Open3D: pip install denseface") from error
    return o3d
