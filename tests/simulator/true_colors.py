"""What colour each place of the target's head truly is, as it is lit."""

from dataclasses import dataclass
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tests.simulator.camera_views import DepthView, depth_view, ray_directions, shade
from tests.simulator.heads import load_head
from tests.simulator.kinect import KinectModel
from tests.simulator.labels import Label
from tests.simulator.landmarks import Landmarks
from tests.simulator.scene import Scene
from tests.simulator.world import build_world

__all__ = ["TrueColors"]


@dataclass(frozen=True, eq=False)
class TrueColors:
    """The shaded colour of each true sample of the target's head that the depth camera sees.

    Surface times light, as the colour camera shows it before lens, noise and rounding; it renders
    without exposure or white balance of its own, so that there are none to take out.

    Attributes
    ----------
    points : (k, 3) float64, mm, depth camera frame, about half a depth pixel apart
    colors : (k, 3) float32, RGB (sRGB), 0-255
    seen : (k,) bool, in the colour image and hidden by nothing before it
    feature : (k,) bool, around eyes, brows, nostrils and mouth
    """

    points: NDArray[np.float64]
    colors: NDArray[np.float32]
    seen: NDArray[np.bool_]
    feature: NDArray[np.bool_]

    @classmethod
    def of(cls, scene: Scene, sensor: KinectModel) -> Self:
        """Shade the true surface of a scene's target, face and head."""
        view = depth_view(scene, sensor)
        head = np.isin(view.labels, (Label.FACE, Label.HEAD))
        if not head.any():
            raise ValueError("there is nobody in the scene whose colours could be told")
        world = build_world(scene)
        ways = ray_directions(view.camera)[head.ravel()]
        hits = world.cast(np.zeros(3), ways)
        points = view.depth[head][:, None] * ways
        marks = load_head(scene.people[scene.target].head).landmarks
        return cls(points.astype(np.float64), shade(world, hits, ways, scene.light),
                   _seen(scene, sensor, points), _on_feature(view, head, marks))

    def nearest(self, points: NDArray[np.floating]) -> NDArray[np.int64]:
        """Find the sample nearest each point, (n, 3) mm, depth camera frame: (n,) indices."""
        found: NDArray[np.int64] = np.asarray(self._tree.query(points)[1], np.int64)
        return found

    @cached_property
    def _tree(self) -> "cKDTree[None]":
        return cKDTree(self.points)


def _seen(
    scene: Scene, sensor: KinectModel, points: NDArray[np.float32]
) -> NDArray[np.bool_]:
    camera, to_color = sensor.calibration.color, sensor.calibration.depth_to_color
    u, v = camera.project(to_color.apply(points)).T
    inside = (u > -0.5) & (u < camera.width - 0.5) & (v > -0.5) & (v < camera.height - 0.5)
    origin = -np.array(to_color.rotation).T @ np.array(to_color.translation_mm)
    return np.asarray(inside & build_world(scene).visible(points, origin))


def _on_feature(
    view: DepthView, head: NDArray[np.bool_], marks: Landmarks
) -> NDArray[np.bool_]:
    """Where a face's paint changes within a few millimetres."""
    x, y, z = view.on_head[head].T
    ex, ey, ez = marks.eyes
    spots = ((ex, ey - 6, 22, 20), (8, marks.nose_tip[0] + 7, 12, 9), (0, marks.mouth[0], 30, 13))
    near = np.zeros(len(x), bool)
    for cx, cy, rx, ry in spots:
        near |= np.hypot((np.abs(x) - cx) / rx, (y - cy) / ry) < 1
    return np.asarray(near & (z < ez + 15))
