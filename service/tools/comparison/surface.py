"""A surface as it is compared: points with normals, and how far off each may be."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from denseface.recon.face import Face

__all__ = ["Pose", "Surface"]

_STEP_MM = 1.0
"""Points nearer to each other than this tell no more of a face: a tangent plane is 0.02 mm off."""
_MEASURED = 1.5
"""A point is measured where there is a measured one so near, mean spacings."""
_NEIGHBORS = 12
"""Points that a normal is fitted to, where there are no triangles."""
_MOST_POINTS = 120_000
"""Of a mesh, points are drawn on its triangles, at most so many."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A rigid motion: points @ rotation.T + shift.

    rotation : (3, 3) float64
    shift : (3,) float64, mm
    """

    rotation: NDArray[np.float64]
    shift: NDArray[np.float64]

    @classmethod
    def none(cls) -> Self:
        """Give the motion that leaves everything where it is."""
        return cls(np.eye(3), np.zeros(3))

    def __matmul__(self, first: "Pose") -> "Pose":
        """Give the motion that does `first`, then this."""
        return Pose(self.rotation @ first.rotation, self.rotation @ first.shift + self.shift)

    @property
    def inverse(self) -> "Pose":
        """The motion back."""
        return Pose(self.rotation.T, -self.rotation.T @ self.shift)

    def of(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Move points, (n, 3) mm."""
        return np.asarray(points @ self.rotation.T + self.shift, np.float64)

    @property
    def angle_deg(self) -> float:
        """By how much it turns, degrees."""
        return float(np.degrees(np.arccos(np.clip((np.trace(self.rotation) - 1) / 2, -1, 1))))


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface.

    Attributes
    ----------
    points : (n, 3) float64, mm
    normals : (n, 3) float64, unit length, outward
    sigma : (n,) float64, mm, standard error along the normal; zero where it is not known
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    sigma: NDArray[np.float64]

    @classmethod
    def of_face(cls, face: Face) -> Self:
        """Take the dense points that were measured, about `_STEP_MM` apart along x and y.

        What the engine closed or a model of faces added, away from all measured points, has no
        part in a comparison.
        """
        cloud = face.dense
        every = max(1, round(_STEP_MM / cloud.grid_step_mm))
        kept = (cloud.cells % every == 0).all(axis=1)
        away, _ = cKDTree(face.initial.points[:, :2]).query(
            cloud.points[kept, :2],
            distance_upper_bound=_MEASURED * max(face.report.mean_spacing_mm, cloud.grid_step_mm))
        kept[kept] = np.isfinite(away)
        points, normals = (one[kept].astype(np.float64) for one in (cloud.points, cloud.normals))
        rays = points / np.linalg.norm(points, axis=1, keepdims=True)
        return cls(points, normals, cloud.sigma[kept] * np.abs((normals * rays).sum(axis=1)))

    @classmethod
    def of_mesh(
        cls, points: NDArray[np.floating], triangles: NDArray[np.integer] | None
    ) -> Self:
        """Draw points on a mesh, about `_STEP_MM` apart, or take the points of a cloud.

        points : (n, 3), mm; triangles : (t, 3), counter-clockwise from outside, or None
        """
        places: NDArray[np.float64] = np.asarray(points, np.float64)
        if triangles is None or not len(triangles):
            return cls(places, _fitted_normals(places), np.zeros(len(places)))
        corners = places[triangles]
        across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = np.linalg.norm(across, axis=1) / 2
        normals = np.zeros(places.shape)
        for k in range(3):
            np.add.at(normals, triangles[:, k], across)
        total = float(area.sum())
        count = int(min(max(total / _STEP_MM**2, 1), _MOST_POINTS))
        rng = np.random.default_rng(0)
        chosen = np.searchsorted(np.cumsum(area), np.sort(rng.random(count)) * total)
        chosen = np.minimum(chosen, len(area) - 1)
        u, v = rng.random((2, count))
        over = u + v > 1
        u[over], v[over] = 1 - u[over], 1 - v[over]
        weights = np.stack([1 - u - v, u, v], axis=1)
        drawn = np.einsum("kc,kcd->kd", weights, corners[chosen])
        between = np.einsum("kc,kcd->kd", weights, _unit(normals)[triangles[chosen]])
        return cls(drawn, _unit(between), np.zeros(count))

    def __len__(self) -> int:
        return len(self.points)

    @cached_property
    def tree(self) -> cKDTree:
        """Finds the nearest points."""
        return cKDTree(self.points)

    def moved(self, pose: Pose) -> "Surface":
        """Give it moved."""
        return replace(self, points=pose.of(self.points),
                       normals=np.asarray(self.normals @ pose.rotation.T, np.float64))

    def rows(self, chosen: NDArray[np.bool_] | NDArray[np.integer]) -> "Surface":
        """Give some of its points."""
        return Surface(self.points[chosen], self.normals[chosen], self.sigma[chosen])

    def nearest(
        self, points: NDArray[np.float64], count: int, most_mm: float
    ) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
        """Find the nearest of its points to each of some, no farther than a distance.

        Gives distances, (n, count) mm, inf where there is none so near, and rows, (n, count).
        """
        away, rows = self.tree.query(points, range(1, count + 1), distance_upper_bound=most_mm)
        return np.asarray(away, np.float64), np.asarray(rows, np.intp)

    def thinned(self, step_mm: float) -> "Surface":
        """Give a point of each cube of `step_mm`, the one nearest to its middle."""
        places = self.points / step_mm
        cells = np.floor(places).astype(np.int64)
        away = ((places - cells - 0.5) ** 2).sum(axis=1)
        order = np.lexsort((away, *cells.T))
        first = np.ones(len(order), bool)
        first[1:] = (cells[order[1:]] != cells[order[:-1]]).any(axis=1)
        return self.rows(np.sort(order[first]))


def _fitted_normals(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Fit planes to neighbours; normals toward the camera."""
    _, near = cKDTree(points).query(points, min(_NEIGHBORS, len(points)))
    around = points[near] - points[near].mean(axis=1, keepdims=True)
    _, axes = np.linalg.eigh(np.einsum("nki,nkj->nij", around, around))
    normals = axes[:, :, 0]
    return np.asarray(normals * -np.sign((normals * points).sum(axis=1, keepdims=True)))


def _unit(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(vectors / np.maximum(lengths, 1e-12), np.float64)
