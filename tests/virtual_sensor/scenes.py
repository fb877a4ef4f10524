"""Clips that are ready to be shown: a cheap one without a face, and one of a face that moves."""

import hashlib
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denseface.capture.calibration import Calibration, CameraModel
from tests.simulator import KINECT_DEFAULT, KinectModel, Person, Scene, Truth, simulate
from tests.virtual_sensor.clip import write_clip

__all__ = ["FaceClip", "cheap_clip", "cheap_frames", "face_clip"]

_FOLDER = Path(__file__).resolve().parents[2] / "build" / "virtual_sensor" / "clips"
"""Where faces are kept between runs."""
_SIMULATOR = Path(__file__).resolve().parents[1] / "simulator"
_WALL_MM, _BALL_MM, _RADIUS_MM = 1600.0, 850.0, 130.0
_SWING_MM = 150.0
"""How far the ball moves to either side."""
_TILE_MM = 90.0
"""Of the wall's pattern."""
Image = tuple[NDArray[np.uint16], NDArray[np.uint8]]


def cheap_frames(count: int = 10, sensor: KinectModel = KINECT_DEFAULT) -> list[Image]:
    """Give (depth, color) frames of a ball that swings to and fro before a patterned wall.

    Both are rendered from the sensor's geometry: outlines of depth are edges of colour where they
    belong. Some 50 ms a frame to make, and the same each time.
    """
    angles = 2 * np.pi * np.arange(count) / count
    return [_ball(sensor.calibration, _SWING_MM * float(np.sin(angle))) for angle in angles]


def cheap_clip(path: Path, count: int = 10, sensor: KinectModel = KINECT_DEFAULT) -> Path:
    """Write the clip of `cheap_frames`, and give its path."""
    write_clip(path, cheap_frames(count, sensor), calibration=sensor.calibration)
    return path


def _ball(calibration: Calibration, x: float) -> Image:
    z, _ = _seen(calibration.depth, np.eye(3), np.zeros(3), x)
    R = np.array(calibration.depth_to_color.rotation)
    t = np.array(calibration.depth_to_color.translation_mm)
    _, color = _seen(calibration.color or calibration.depth, R, t, x)
    return np.rint(z).astype(np.uint16), color


def _seen(
    camera: CameraModel, R: NDArray[np.float64], t: NDArray[np.float64], x: float
) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Give z (mm) and colour at each pixel of a camera with X_camera = R X + t."""
    shape = (camera.height, camera.width, 1)
    rays = np.concatenate([camera.rays(), np.ones(shape)], -1) @ R  # in the depth camera's frame
    origin = -t @ R
    to_wall = (_WALL_MM - origin[2]) / rays[..., 2]
    centre = np.array([x, 0.0, _BALL_MM]) - origin
    a, b = (rays * rays).sum(-1), rays @ centre
    root = b * b - a * (centre @ centre - _RADIUS_MM ** 2)
    hit = root > 0
    length = np.where(hit, (b - np.sqrt(np.where(hit, root, 0))) / a, to_wall)
    points = rays * length[..., None] + origin
    tiles = np.floor(points[..., :2] / _TILE_MM).astype(np.int64)
    column, row = tiles[..., 0], tiles[..., 1]
    wall = np.stack([130 + 60 * ((column + row) % 2), 120 + 25 * (column % 3),
                     150 - 20 * (row % 3)], -1)
    normal_z = np.clip((_BALL_MM - points[..., 2]) / _RADIUS_MM, 0, 1)
    ball = np.stack([225 * normal_z, 90 * normal_z, 60 * normal_z], -1)
    color = np.where(hit[..., None], ball, wall)
    z = (points @ R.T + t)[..., 2]
    return z, np.rint(color).astype(np.uint8)


@dataclass(frozen=True)
class FaceClip:
    """A face that moves a little from frame to frame."""

    path: Path
    people: tuple[Person, ...]
    """Who stands there at each frame: the true motion."""
    sensor: KinectModel

    def truth(self, frame: int) -> Truth:
        """Load the true surface of a frame."""
        return Truth.load(self.path.parent / f"{frame}.truth.npz")


def face_clip(
    frames: int = 4, *, step_mm: float = 2.0, turn_deg: float = 0.0, person: Person | None = None,
    sensor: KinectModel = KINECT_DEFAULT, seed: int = 0,
) -> FaceClip:
    """Give a clip of a face; simulated (2 s a frame) where it was not before, then kept.

    Parameters
    ----------
    step_mm : how far it moves to the right between two frames
    turn_deg : how far it turns between two frames
    person : who it is at first; the head made by code by default, at 700 mm
    """
    first = person or Person()
    start = -(frames - 1) / 2
    people = tuple(
        Person(**{**vars(first), "yaw": first.yaw + turn_deg * (start + index), "offset_mm": (
            first.offset_mm[0] + step_mm * (start + index), first.offset_mm[1])})
        for index in range(frames))
    code = b"".join(path.read_bytes() for path in sorted(_SIMULATOR.glob("*.py")))
    key = hashlib.sha256(code + repr((people, sensor, sensor.calibration, seed)).encode())
    folder = _FOLDER / key.hexdigest()[:16]
    if not folder.is_dir():
        _simulate(folder, people, sensor, seed)
    return FaceClip(folder / "clip", people, sensor)


def _simulate(folder: Path, people: tuple[Person, ...], sensor: KinectModel, seed: int) -> None:
    folder.parent.mkdir(parents=True, exist_ok=True)
    # Made aside and renamed: tests in parallel never see half a folder.
    with tempfile.TemporaryDirectory(dir=folder.parent) as scratch:
        made = Path(scratch) / folder.name
        made.mkdir()
        images = []
        for index, person in enumerate(people):
            (shot,) = simulate(Scene((person,)), sensor, seed + index)
            assert shot.frame.color is not None
            images.append((shot.frame.depth, shot.frame.color))
            shot.truth.save(made / f"{index}.truth.npz")
        write_clip(made / "clip", images, calibration=sensor.calibration)
        try:
            made.rename(folder)
        except OSError:
            if not folder.is_dir():
                raise
