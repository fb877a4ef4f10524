"""A layer of depth as a relief, drawn at one scale and as seen from the front of a turned head."""

from functools import cache
from typing import NamedTuple

import cv2
import numpy as np

from denseface.capture.calibration import CameraModel
from denseface.recon.arrays import Bools, Bytes, Doubles, Floats, Ints
from denseface.recon.detection._regions import CELLS, Region
from denseface.recon.detection._view_kernels import (
    Surface,
    View,
    draw_view,
    finish_view,
    surface_samples,
)
from denseface.recon.face import Box

PIXEL_MM = 4.0
"""Side of a view's pixels, and about that of the samples that are drawn: a face is 40 wide."""
_BEYOND_MM = 120.0
"""How much nearer and farther than a layer the sides of a face in it may be."""
_REACH_MM = 110.0
"""From the middle of a face as far as a box around it goes."""
_SMOOTH_PX = 0.7
"""Standard deviation of the smoothing of the samples: each is the mean of those pixels of the
depth image that it covers already."""
_SURROUNDINGS_PX = 3.0
"""The same of the surroundings above which relief stands out: eye sockets, nose and mouth."""
_LIGHT = (0.0, -0.6, -1.0)
"""Where the light comes from in each view: the camera and above, as on most photographs."""
_LIT = 204.0
"""Grey of a surface that faces it; the rest is left for what stands out."""
_GREY_PER_MM = 6.0
"""What stands out is lighter and what lies deep darker, as where light comes from all sides.
Without it 12 and 8 of 93 faces are found in the views from 40 degrees left and right, with 10
levels 26 and 26; 20 find fewer in all than none."""
_GAP_PX = 1.0
"""Standard deviation of the weights by which pixels without a sample are filled."""
_LEAST_WEIGHT = 0.1
"""Less of it, and a pixel stays black."""
_ABOUT_PX = 3
"""Samples at most so far from a view's pixel, each way, tell where it is in the depth image."""


class Drawn(NamedTuple):
    """A view."""

    grey: Bytes
    """(H, W)."""
    centers: Bools
    """(H, W): where the centre of a face can be."""
    source: Ints
    """(H, W), which sample of the layer is seen; -1 for none."""


class Layer:
    """The depth of one region, ready to be drawn."""

    def __init__(self, depth_mm: Floats, camera: CameraModel, region: Region) -> None:
        self._camera = camera
        cell = camera.width / CELLS
        self._left, self._top, width, height = _reached(region, camera, cell)
        part = depth_mm[self._top:self._top + height, self._left:self._left + width]
        measured = ((part > region.near_mm - _BEYOND_MM)
                    & (part < region.far_mm + _BEYOND_MM)).astype(np.float32)
        step = max(1.0, PIXEL_MM * camera.fx / np.sqrt(region.near_mm * region.far_mm))
        size = max(1, round(width / step)), max(1, round(height / step))
        self._step = width / size[0], height / size[1]
        weight = _smooth(_shrunk(measured, size), _SMOOTH_PX)
        self.depth = _by_weight(_smooth(_shrunk(part * measured, size), _SMOOTH_PX), weight)
        there = (weight > _LEAST_WEIGHT).astype(np.float32)
        surroundings = _by_weight(_smooth(self.depth * there, _SURROUNDINGS_PX),
                                  _smooth(there, _SURROUNDINGS_PX))
        rows, columns = (np.minimum((first + side * (np.arange(count) + 0.5)) / cell, last - 1)
                         .astype(np.intp) for first, side, count, last in zip(
                             (self._top, self._left), self._step[::-1], size[::-1],
                             region.centers.shape, strict=True))
        self._centers = region.centers[np.ix_(rows, columns)] & (there > 0)
        self._surface = self._sampled(weight, surroundings - self.depth)
        self._middles = self._surface.points[self._centers.ravel()[self._surface.places]]

    def _sampled(self, weight: Floats, relief: Floats) -> Surface:
        side = 2 * round(_REACH_MM / PIXEL_MM) + 1
        near_face = cv2.dilate(self._centers.view(np.uint8), np.ones((side, side), np.uint8)) > 0
        count = self.depth.size
        surface = Surface(np.empty((count, 3), np.float32), np.empty((count, 3), np.float32),
                          np.empty(count, np.float32), np.empty(count, np.int32))
        camera = self._camera
        x, y = self._pixels(0.0, 0.0)
        count = surface_samples(
            self.depth, weight, relief, near_face,
            ((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy),
            (self._step[0] / camera.fx, self._step[1] / camera.fy), surface)
        return Surface(surface.points[:count], surface.normals[:count], surface.relief[:count],
                       surface.places[:count])

    def _pixels(self, row: float, column: float) -> tuple[float, float]:
        """Give x and y in the depth image of a place on the grid of samples."""
        return (self._left + self._step[0] * (column + 0.5) - 0.5,
                self._top + self._step[1] * (row + 0.5) - 0.5)

    def view(self, turn: Doubles) -> Drawn | None:
        """Draw what may be a face, turned by (3, 3) `turn`; None where there is nothing."""
        if not len(self._middles):
            return None
        middle = self._middles.mean(axis=0).astype(np.float64)
        reached = np.abs((self._middles - middle) @ turn[:2].T).max(axis=0) + _REACH_MM
        columns, rows = np.ceil(2 * reached / PIXEL_MM).astype(int).tolist()
        shape = rows, columns
        drawn = View(np.full(shape, np.finfo(np.float32).max), np.zeros(shape, np.float32),
                     np.zeros(shape, np.float32), np.full(shape, -1, np.int32))
        light = _LIT / float(np.linalg.norm(_LIGHT))
        draw_view(self._surface, turn, middle, PIXEL_MM,
                  (light * _LIGHT[0], light * _LIGHT[1], light * _LIGHT[2]), _GREY_PER_MM, drawn)
        grey, centers = np.zeros(shape, np.uint8), np.zeros(shape, np.bool_)
        finish_view(drawn, _smooth(drawn.grey, _GAP_PX), _smooth(drawn.seen, _GAP_PX),
                    _LEAST_WEIGHT, self._centers, grey, centers)
        return Drawn(grey, centers, drawn.source)

    def place(self, view: Drawn, u: float, v: float) -> tuple[float, float, float] | None:
        """Give x, y and depth, mm, in the depth image of a place in a view; None for nowhere."""
        row, column = int(v), int(u)
        about = view.source[max(row - _ABOUT_PX, 0):row + _ABOUT_PX + 1,
                            max(column - _ABOUT_PX, 0):column + _ABOUT_PX + 1]
        rows, columns = np.divmod(about[about >= 0], self.depth.shape[1])
        if not len(rows):
            return None
        row, column = int(np.median(rows)), int(np.median(columns))
        return *self._pixels(row, column), float(self.depth[row, column])


def _reached(region: Region, camera: CameraModel, cell: float) -> Box:
    """Give the part of the depth image that boxes about a region's centres can cover."""
    x, y, w, h = cv2.boundingRect(region.centers.view(np.uint8))
    margin = _REACH_MM * camera.fx / region.near_mm
    left, top = max(round(x * cell - margin), 0), max(round(y * cell - margin), 0)
    return (left, top, min(round((x + w) * cell + margin), camera.width) - left,
            min(round((y + h) * cell + margin), camera.height) - top)


@cache
def turned(yaw: float, pitch: float, roll: float) -> Doubles:
    """Give (3, 3), from the camera's axes to those of who looks at a head that is turned so.

    Degrees: positive yaw is toward the image's right, positive pitch up, positive roll clockwise.
    """
    (a, b, c), (d, e, f) = np.cos(angles := np.radians((pitch, yaw, -roll))), np.sin(angles)
    about_x = np.array([[1, 0, 0], [0, a, -d], [0, d, a]])
    about_y = np.array([[b, 0, e], [0, 1, 0], [-e, 0, b]])
    about_z = np.array([[c, -f, 0], [f, c, 0], [0, 0, 1]])
    turn: Doubles = about_x @ about_y @ about_z
    return turn


def _shrunk(image: Floats, size: tuple[int, int]) -> Floats:
    return np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)


def _smooth(image: Floats, sigma: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(image, (0, 0), sigma), np.float32)


def _by_weight(summed: Floats, weight: Floats) -> Floats:
    return np.asarray(summed / np.maximum(weight, 1e-6), np.float32)
