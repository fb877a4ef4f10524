"""What each camera would see without noise, cast once for each scene and sensor."""

from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import CameraModel
from tests.simulator.kinect import KinectModel
from tests.simulator.scene import Light, Scene
from tests.simulator.world import Hits, World, build_world, dot

__all__ = ["SUPERSAMPLING", "DepthView", "color_view", "depth_view", "ray_directions", "shade"]

SUPERSAMPLING = 2
"""Rays for each pixel along x and along y."""

_GAMMA = 1 / 2.2


@dataclass(frozen=True, eq=False)
class DepthView:
    """The true surface on the supersampled grid of the depth camera.

    Attributes
    ----------
    camera : the depth camera at `SUPERSAMPLING` times its resolution
    depth : (H, W) float32, mm along z, 0 where nothing
    labels : (H, W) uint8 of `Label`
    lit : (H, W) bool, the projector sees it too
    slant : (H, W) float32, cosine between the surface's normal and the ray
    albedo : (H, W) float32, how light the target's head is, 0-1 linear, 0 off it
    on_head : (H, W, 3) float32, mm, the target head's frame, NaN off it and its hair
    hair : (H, W) bool, the target's hair or beard
    """

    camera: CameraModel
    depth: NDArray[np.float32]
    labels: NDArray[np.uint8]
    lit: NDArray[np.bool_]
    slant: NDArray[np.float32]
    albedo: NDArray[np.float32]
    on_head: NDArray[np.float32]
    hair: NDArray[np.bool_]


def depth_view(scene: Scene, sensor: KinectModel) -> DepthView:
    """Cast the depth camera's rays and, where they end, look back at the projector."""
    return _depth_view(replace(scene, light=Light(), holes=0.0), sensor)


@lru_cache(maxsize=4)
def _depth_view(scene: Scene, sensor: KinectModel) -> DepthView:
    world = build_world(scene)
    camera = sensor.calibration.depth.scaled(SUPERSAMPLING)
    shape = (camera.height, camera.width)
    directions = ray_directions(camera)
    hits = world.cast(np.zeros(3), directions)
    hit = hits.part >= 0
    depth = np.where(hit, hits.distance, 0).astype(np.float32)
    lit = np.zeros(len(depth), bool)
    lit[hit] = world.visible(depth[hit, None] * directions[hit],
                             np.array(sensor.projector_mm, np.float32))
    unit = directions / np.sqrt(dot(directions, directions))[:, None]
    slant = np.abs(dot(world.normals(hits), unit))
    return DepthView(
        camera=camera, depth=depth.reshape(shape), labels=world.labels(hits).reshape(shape),
        lit=lit.reshape(shape), slant=slant.reshape(shape).astype(np.float32),
        albedo=world.colors(hits, head_only=True).mean(axis=1).reshape(shape),
        on_head=world.on_head(hits).reshape(*shape, 3), hair=world.on_hair(hits).reshape(shape),
    )


@lru_cache(maxsize=4)
def color_view(scene: Scene, sensor: KinectModel) -> NDArray[np.float32]:
    """Render the colour camera's image without noise: (H, W, 3) float32, RGB 0-255."""
    world = build_world(replace(scene, light=Light(), holes=0.0))
    to_color = sensor.calibration.depth_to_color
    R, t = np.array(to_color.rotation), np.array(to_color.translation_mm)
    camera = sensor.calibration.color.scaled(SUPERSAMPLING)
    directions = np.einsum("nd,de->ne", ray_directions(camera), R.astype(np.float32))
    origin = -R.T @ t
    image = shade(world, world.cast(origin, directions), directions, scene.light)
    size = (sensor.calibration.color.width, sensor.calibration.color.height)
    # A lens and the Bayer pattern blur by about half a pixel.
    full = cv2.GaussianBlur(image.reshape(camera.height, camera.width, 3), (0, 0), 1.0)
    return np.asarray(cv2.resize(full, size, interpolation=cv2.INTER_AREA), np.float32)


def shade(
    world: World, hits: Hits, directions: NDArray[np.float32], light: Light
) -> NDArray[np.float32]:
    """Give the colour of each hit, (n, 3) float32 RGB (sRGB) 0-255: Lambert and ambient."""
    normals = world.normals(hits)
    away = np.sign(dot(normals, directions))
    toward = np.array(light.toward) / np.linalg.norm(light.toward)
    facing = np.einsum("nd,d->n", normals, toward.astype(np.float32))
    lambert = np.maximum(-away * facing, 0)
    brightness = light.ambient + light.intensity * lambert
    linear = world.colors(hits) * brightness[:, None].astype(np.float32)
    return np.asarray(255 * np.clip(linear, 0, 1) ** _GAMMA, np.float32)


def ray_directions(camera: CameraModel) -> NDArray[np.float32]:
    """Give each pixel's ray with z = 1, (H W, 3) float32."""
    rays = camera.rays().reshape(-1, 2)
    return np.concatenate([rays, np.ones((len(rays), 1))], axis=1).astype(np.float32)
