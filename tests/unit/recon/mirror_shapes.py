"""Points of a face-like shape with two like sides, seen from anywhere."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from denseface.recon.detail._mirror_plane import MirrorPlane

NEAR = np.array([0.0, 0.0, 700.0])

Floats = NDArray[np.float64]


def height(x: Floats, y: Floats) -> Floats:
    """Brow, nose, eyes and mouth on an egg, mm toward +z; even in x."""
    egg = 95 * (1 - np.sqrt(np.maximum(1 - (x / 80) ** 2 - (y / 110) ** 2, 0)))
    across = np.abs(x)
    nose = 20 * np.exp(-((x / 10) ** 2) / 2 - (((y - 12) / 16) ** 2) / 2)
    eyes = 6 * np.exp(-(((across - 30) / 9) ** 2) / 2 - (((y + 22) / 6) ** 2) / 2)
    lips = 4 * np.exp(-((x / 18) ** 2) / 2 - (((y - 52) / 5) ** 2) / 2)
    found: Floats = egg - nose + eyes - lips
    return found


class Pose:
    """How the face is held, degrees, and where its middle is, mm."""

    def __init__(self, yaw: float = 0, pitch: float = 0, roll: float = 0,
                 shift: tuple[float, float, float] = (0, 0, 0)) -> None:
        self.rotation = Rotation.from_euler("ZYX", [roll, yaw, pitch], degrees=True).as_matrix()
        self.shift = NEAR + shift
        normal = self.rotation[:, 0]
        self.plane = MirrorPlane(normal, float(normal @ self.shift))

    def placed(self, points: Floats) -> Floats:
        """From the face's own frame to the camera's, (n, 3) mm."""
        found: Floats = points @ self.rotation.T + self.shift
        return found

    def own(self, points: NDArray[np.floating]) -> Floats:
        """From the camera's frame to the face's own, (n, 3) mm."""
        found: Floats = (points - self.shift) @ self.rotation
        return found


def face_points(
    pose: Pose, spacing: float = 1.5, one_side: Callable[[Floats, Floats], Floats] | None = None
) -> Floats:
    """Points of the face, (n, 3) mm, camera frame.

    one_side : what is added to the height, given x and y
    """
    axis = np.arange(-100, 100, spacing)
    x, y = (grid.ravel() for grid in np.meshgrid(axis, axis))
    inside = (x / 66) ** 2 + (y / 90) ** 2 < 1
    x, y = x[inside], y[inside]
    own = 0 if one_side is None else one_side(x, y)
    return pose.placed(np.column_stack([x, y, height(x, y) + own]))
