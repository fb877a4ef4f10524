"""A small renderer of calibration boards: through known cameras, with distortion, blur and noise.

Rays of a camera are cut with the board's plane, three by three in a pixel, and the board's picture
is looked up there.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor

__all__ = ["Poses", "RenderedBoard", "charuco", "checkerboard", "kinect", "sensor", "various_poses"]

_SUPERSAMPLED = 3
_PAPER, _INK, _ROOM = 225.0, 30.0, 120.0
"""Grey levels."""
_TEXELS = 40
"""Of a square's side."""


class RenderedBoard(NamedTuple):
    """A picture and its size; its centre is the origin of a pose, x right, y down."""

    texture: NDArray[np.float32]
    width_mm: float
    height_mm: float


class Poses(NamedTuple):
    """Where the board is in the depth camera's frame."""

    rotation: NDArray[np.float64]
    center_mm: NDArray[np.float64]


def checkerboard(columns: int, rows: int, square_mm: float) -> RenderedBoard:
    """Give a board of this many inner corners, with a white rim of one square."""
    squares = np.indices((rows + 1, columns + 1)).sum(axis=0) % 2
    texture = np.pad(np.where(squares == 0, _INK, _PAPER), 1, constant_values=_PAPER)
    texture = np.kron(texture, np.ones((_TEXELS, _TEXELS)))
    return RenderedBoard(texture.astype(np.float32), (columns + 3) * square_mm,
                         (rows + 3) * square_mm)


def charuco(board: "cv2.aruco.CharucoBoard") -> RenderedBoard:
    """Give OpenCV's picture of a board, with a white rim of one square."""
    columns, rows = board.getChessboardSize()
    picture = board.generateImage((columns * _TEXELS, rows * _TEXELS), marginSize=0, borderBits=1)
    texture = np.pad(_INK + picture / 255.0 * (_PAPER - _INK), _TEXELS, constant_values=_PAPER)
    square = board.getSquareLength()
    return RenderedBoard(texture.astype(np.float32), (columns + 2) * square, (rows + 2) * square)


@lru_cache(maxsize=4)
def _rays(camera: CameraModel) -> NDArray[np.float32]:
    """Give the rays of the parts of pixels: between those of pixels they are straight enough."""
    size = camera.width * _SUPERSAMPLED, camera.height * _SUPERSAMPLED
    return cv2.resize(camera.rays(), size, interpolation=cv2.INTER_LINEAR).astype(np.float32)


@dataclass(frozen=True)
class sensor:  # noqa: N801  (it is used like a function)
    """Two cameras that see the same board."""

    calibration: Calibration
    blur_px: float = 0.7
    noise: float = 3.0
    """Standard deviation, grey levels."""

    def views(self, board: RenderedBoard, pose: Poses, seed: int) -> tuple[
            NDArray[np.uint8], NDArray[np.uint8]]:
        """Give what the depth camera and the colour camera see, both (H, W) uint8."""
        rng = np.random.default_rng(seed)
        to_color = self.calibration.depth_to_color
        R = np.array(to_color.rotation)
        moved = Poses(R @ pose.rotation, R @ pose.center_mm + to_color.translation_mm)
        return (self._seen(self.calibration.depth, board, pose, rng),
                self._seen(self.calibration.color, board, moved, rng))

    def _seen(
        self, camera: CameraModel, board: RenderedBoard, pose: Poses, rng: np.random.Generator
    ) -> NDArray[np.uint8]:
        rays = _rays(camera)
        # A point of the board is rotation @ (x, y, 0) + center: the plane's homography.
        H = np.linalg.inv(np.column_stack([pose.rotation[:, :2], pose.center_mm]))
        height, width = board.texture.shape
        H = np.array([[width / board.width_mm, 0, width / 2 - 0.5],
                      [0, height / board.height_mm, height / 2 - 0.5], [0, 0, 1]]) @ H
        u, v, w = (rays[..., 0] * np.float32(row[0]) + rays[..., 1] * np.float32(row[1])
                   + np.float32(row[2]) for row in H)
        u /= w
        v /= w
        image = cv2.remap(board.texture, u, v,
                          cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT, borderValue=_ROOM)
        image = cv2.resize(image, (camera.width, camera.height), interpolation=cv2.INTER_AREA)
        image = cv2.GaussianBlur(image, (0, 0), self.blur_px)
        noisy = image + rng.normal(0, self.noise, image.shape)
        return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def various_poses(count: int, seed: int = 1) -> list[Poses]:
    """Give boards 250 mm wide at 0.4 to 0.75 m, tilted to all sides, all over the image.

    Every other one stands upright: what is along and what is across are seen alike.
    """
    rng = np.random.default_rng(seed)
    poses = []
    for number in range(count):
        z = rng.uniform(400, 750)
        around, tilt = 2 * np.pi * number / count, np.radians(rng.uniform(15, 40))
        R = Rotation.from_rotvec([tilt * np.cos(around), tilt * np.sin(around), 0]).as_matrix()
        roll = rng.uniform(-25, 25) + 90 * (number % 2)
        R = R @ Rotation.from_rotvec([0, 0, np.radians(roll)]).as_matrix()
        # As far out as a Kinect v1's cameras see all of it.
        farthest = np.array([0.53 * z - 150, 0.39 * z - 130])
        poses.append(Poses(R, np.array([*(rng.uniform(-1, 1, 2) * farthest + (10, 0)), z])))
    return poses


def kinect() -> Calibration:
    """Give a sensor like a Kinect v1: lenses that distort, cameras that are not parallel."""
    return Calibration(
        depth=CameraModel(width=640, height=480, fx=581.2, fy=580.1, cx=316.4, cy=243.8,
                          distortion=(-0.09, 0.21, 0.0007, -0.0011, 0.0)),
        color=CameraModel(width=640, height=480, fx=523.4, fy=524.2, cx=325.1, cy=251.7,
                          distortion=(0.16, -0.32, -0.0013, 0.0009, 0.0)),
        depth_to_color=DepthToColor(
            rotation=tuple(map(tuple, Rotation.from_euler(
                "xyz", (0.4, -0.7, 0.3), degrees=True).as_matrix().tolist())),
            translation_mm=(-24.6, 0.6, 2.1)))
