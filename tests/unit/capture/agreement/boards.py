"""A made-up scene: upright boards before a wall, seen by both cameras of a Kinect."""

import cv2
import numpy as np

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame

CAMERA = CameraModel(width=640, height=480, fx=575.8, fy=575.8, cx=319.5, cy=239.5)
CALIBRATION = Calibration(
    depth=CAMERA, color=CAMERA.model_copy(update={"fx": 525.0, "fy": 525.0}),
    depth_to_color=DepthToColor(translation_mm=(-23, 0, 0)))
PROJECTOR_MM = (-75.0, 0.0, 0.0)
"""From the depth camera's frame to the projector's."""
WALL = (-5000.0, -5000.0, 5000.0, 5000.0, 2600.0, 120)
BOARDS = ((-420, -260, -180, 300, 1700, 60), (-160, -220, 60, 120, 800, 200),
          (-60, 110, 170, 400, 950, 30), (260, -300, 520, 100, 1400, 230))
"""Left, top, right, bottom, depth, mm, depth camera's frame; grey."""


def boards_frame(moved_mm=0.0, seed=0, boards=BOARDS):
    """Give a frame; the nearest board stands aside by `moved_mm` when colour is taken."""
    rng = np.random.default_rng(seed)
    depth = painted(CAMERA, (0, 0, 0), boards, 4)
    lit = painted(CAMERA, PROJECTOR_MM, boards, 4)
    v, u = np.mgrid[:480, :640]
    seen = np.rint(u + CAMERA.fx * PROJECTOR_MM[0] / depth).astype(int)
    shadow = (seen < 0) | (lit[v, np.clip(seen, 0, 639)] < depth - 30)
    depth = np.where(shadow, 0, depth + rng.normal(0, 1, depth.shape)).clip(0).astype(np.uint16)
    near = min(boards, key=lambda board: board[4], default=None)
    later = tuple((x + moved_mm, y, x2 + moved_mm, *rest) if (x, y, x2, *rest) == near else
                  (x, y, x2, *rest) for x, y, x2, *rest in boards)
    gray = painted(CALIBRATION.color, CALIBRATION.depth_to_color.translation_mm, later, 5)
    blotches = cv2.resize(rng.normal(0, 14, (48, 64)), (640, 480), interpolation=cv2.INTER_CUBIC)
    color = (gray + blotches)[..., None] + rng.normal(0, 3, (480, 640, 3))
    return RgbdFrame(depth, color.clip(0, 255).astype(np.uint8), 2000, 1000, CALIBRATION)


def painted(camera, shift, boards, value):
    """Give an image of a camera: the boards' depth (4) or grey (5), the farthest painted first."""
    image = np.zeros((camera.height, camera.width))
    for board in sorted((WALL, *boards), key=lambda one: -one[4]):
        corners = np.array([board[:2], board[2:4]], float) + shift[:2]
        (left, top), (right, bottom) = np.rint(
            corners / board[4] * camera.fx + (camera.cx, camera.cy)).astype(int)
        cv2.rectangle(image, (left, top), (right, bottom), board[value], -1)
    return image
