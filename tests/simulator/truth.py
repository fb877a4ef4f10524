"""The true surface that a simulated frame shows."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Self

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import CameraModel
from tests.simulator.camera_views import DepthView
from tests.simulator.caster import Caster
from tests.simulator.labels import Label

__all__ = ["Truth"]

_UNIT_MM = 0.02
_STEEPEST = 10.0
"""Neighbouring samples whose depths differ by more than this many lateral steps are not joined."""
_MARGIN = 32
_TARGET = (Label.FACE, Label.HEAD, Label.BODY, Label.HAND, Label.GLASSES)


@dataclass(frozen=True, eq=False)
class Truth:
    """The clean depth of the target person as the depth camera sees it, around the head.

    Attributes
    ----------
    camera : the depth camera at twice its resolution, distortion included
    left, top : where `depth` and `labels` begin in that camera's pixels
    depth : (h, w) float32, mm along z, to 0.02 mm; 0 off the target person
    labels : (h, w) uint8 of `Label`
    """

    camera: CameraModel
    left: int
    top: int
    depth: NDArray[np.float32]
    labels: NDArray[np.uint8]

    @classmethod
    def of(cls, view: DepthView) -> Self:
        """Crop a view to the target's head; empty (0, 0) where there is nobody."""
        rows, columns = np.nonzero((view.labels == Label.FACE) | (view.labels == Label.HEAD)
                                   | (view.labels == Label.GLASSES))
        if not len(rows):
            empty = np.zeros((0, 0))
            return cls(view.camera, 0, 0, empty.astype(np.float32), empty.astype(np.uint8))
        top, left = max(rows.min() - _MARGIN, 0), max(columns.min() - _MARGIN, 0)
        window = np.s_[top:rows.max() + _MARGIN, left:columns.max() + _MARGIN]
        labels = view.labels[window].copy()
        depth = np.where(np.isin(labels, _TARGET), view.depth[window], 0)
        return cls(view.camera, int(left), int(top), _from_units(_to_units(depth)), labels)

    def save(self, path: str | Path) -> None:
        """Write an `.npz` without pickles.

        Raises
        ------
        ValueError
            Where the target's depth spans more than the format holds, 1310 mm.
        """
        units = _to_units(self.depth)
        inside = self.depth > 0
        first = int(units[inside].min()) if inside.any() else 0
        steps = np.where(inside, units - first, 0)
        if steps.max(initial=0) > 65535:
            raise ValueError(f"depth spans {steps.max() * _UNIT_MM:.0f} mm, at most 1310")
        # Differences of differences, high and low bytes apart: what deflate packs best.
        packed: NDArray[np.uint16] = steps.astype(np.uint16)
        for _ in range(2):
            packed = np.concatenate([packed[:, :1], packed[:, 1:] - packed[:, :-1]], axis=1)
        with Path(path).open("wb") as file:
            np.savez_compressed(
                file, low=(packed & 255).astype(np.uint8), high=(packed >> 8).astype(np.uint8),
                inside=np.packbits(inside), labels=self.labels,
                place=np.array([self.left, self.top, first], np.int64),
                camera=np.array(self.camera.model_dump_json()),
            )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote."""
        with np.load(path, allow_pickle=False) as data:
            labels = data["labels"]
            packed = data["low"] + data["high"].astype(np.uint16) * np.uint16(256)
            inside = np.unpackbits(data["inside"], count=labels.size).reshape(labels.shape) > 0
            left, top, first = (int(value) for value in data["place"])
            camera = CameraModel.model_validate_json(str(data["camera"]))
        for _ in range(2):
            packed = np.cumsum(packed, axis=1, dtype=np.uint16)
        units = np.where(inside, packed.astype(np.int64) + first, 0)
        return cls(camera, left, top, _from_units(units), labels)

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """The true surface at each sample, (h, w, 3) mm, depth camera frame; zero where none."""
        v, u = np.mgrid[:self.depth.shape[0], :self.depth.shape[1]]
        pixels = np.stack([u + self.left, v + self.top], axis=-1)
        return self.camera.back_project(pixels, self.depth)

    def face_points(self) -> NDArray[np.float64]:
        """Give the true points of the visible face, (k, 3) mm, depth camera frame."""
        found: NDArray[np.float64] = self.points[self.labels == Label.FACE]
        return found

    def surface_distance(
        self, points: NDArray[np.floating],
        labels: tuple[Label, ...] = (Label.FACE, Label.HEAD),
    ) -> NDArray[np.float64]:
        """Measure how far points are from the true visible surface.

        Parameters
        ----------
        points : (n, 3) float, mm, depth camera frame
        labels : which parts of the target person are the surface

        Returns
        -------
        (n,) float64, mm; inf where there is no surface at all
        """
        caster = self._caster(frozenset(labels))
        if caster is None:
            return np.full(len(points), np.inf)
        return caster.distance(points)

    def labels_at(self, points: NDArray[np.floating]) -> NDArray[np.uint8]:
        """Give the label of the pixel that each point falls on, (n,) uint8; 0 off the crop.

        points : (n, 3) float, mm, depth camera frame
        """
        return self._nearest(self.labels, points)

    def depth_error(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Give each point's z less the true z along its ray, (n,) mm; NaN off the target.

        points : (n, 3) float, mm, depth camera frame. Bilinear in the true depth; NaN where one
        of the four samples around is not on the same surface.
        """
        depth = self.depth.astype(np.float64)
        out = np.full(len(points), np.nan)
        if min(depth.shape) < 2:
            return out
        u, v = self._pixels(points).T
        column, row = np.floor(u), np.floor(v)
        inside = ((column >= 0) & (row >= 0) & (column < depth.shape[1] - 1)
                  & (row < depth.shape[0] - 1))
        j, i = column[inside].astype(np.int64), row[inside].astype(np.int64)
        a, b = u[inside] - j, v[inside] - i
        corners = np.stack([depth[i, j], depth[i, j + 1], depth[i + 1, j], depth[i + 1, j + 1]])
        one = ((corners > 0).all(axis=0)
               & (np.ptp(corners, axis=0) < self._largest_step(corners.max(axis=0))))
        true = ((1 - b) * ((1 - a) * corners[0] + a * corners[1])
                + b * ((1 - a) * corners[2] + a * corners[3]))
        out[inside] = np.where(one, np.asarray(points)[inside, 2] - true, np.nan)
        return out

    def _pixels(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        pixels: NDArray[np.float64] = self.camera.project(points) - [self.left, self.top]
        return pixels

    def _nearest(
        self, image: NDArray[np.uint8], points: NDArray[np.floating]
    ) -> NDArray[np.uint8]:
        column, row = np.rint(self._pixels(points)).T
        inside = ((column >= 0) & (row >= 0) & (column < image.shape[1])
                  & (row < image.shape[0]))
        out = np.zeros(len(points), np.uint8)
        out[inside] = image[row[inside].astype(np.int64), column[inside].astype(np.int64)]
        return out

    def _largest_step(self, depth: NDArray[np.floating]) -> NDArray[np.floating]:
        step: NDArray[np.floating] = _STEEPEST * depth / self.camera.fx
        return step

    def _caster(self, labels: frozenset[Label]) -> Caster | None:
        """Give a ray casting scene of the triangulated surface; None where it is empty."""
        if labels not in self._casters:
            self._casters[labels] = self._triangulate(labels)
        return self._casters[labels]

    @cached_property
    def _casters(self) -> dict[frozenset[Label], Caster | None]:
        return {}

    def _triangulate(self, labels: frozenset[Label]) -> Caster | None:
        height, width = self.depth.shape
        index = np.arange(height * width).reshape(height, width)
        a, b, c, d = index[:-1, :-1], index[:-1, 1:], index[1:, :-1], index[1:, 1:]
        faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3),
                                np.stack([b, d, c], -1).reshape(-1, 3)])
        depth = self.depth.ravel()
        kept = np.isin(self.labels.ravel(), list(labels)) & (depth > 0)
        corners = depth[faces]
        faces = faces[kept[faces].all(axis=1)
                      & (np.ptp(corners, axis=1) < self._largest_step(corners.max(axis=1)))]
        if not len(faces):
            return None
        caster = Caster()
        caster.add(self.points.reshape(-1, 3), faces)
        return caster


def _to_units(depth: NDArray[np.floating]) -> NDArray[np.int64]:
    return np.rint(depth.astype(np.float64) / _UNIT_MM).astype(np.int64)


def _from_units(units: NDArray[np.int64]) -> NDArray[np.float32]:
    return (units * _UNIT_MM).astype(np.float32)
