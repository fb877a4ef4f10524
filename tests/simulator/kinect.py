"""The sensors that are simulated."""

from dataclasses import dataclass, field

from scipy.spatial.transform import Rotation

from denseface.capture.calibration import Calibration, CameraModel, DepthToColor
from tests.simulator.depth_noise import KINECT_V1, DepthNoise

__all__ = ["KINECT_CALIBRATED", "KINECT_DEFAULT", "KinectModel"]


@dataclass(frozen=True)
class KinectModel:
    """A structured-light sensor: two cameras and a projector.

    The colour camera stands between the depth camera and the projector. In images that are not
    mirrored (capture never delivers others) both are on the right, as on a real Kinect: the
    projector is at +x, the translation is negative, and a shadow lies to the left of what casts it.
    """

    name: str
    calibration: Calibration = field(hash=False)
    projector_mm: tuple[float, float, float]
    """Where the projector is, depth camera frame."""
    noise: DepthNoise = KINECT_V1
    """How its depth differs from the truth."""


def _rotation(*degrees: float) -> tuple[tuple[float, float, float], ...]:
    return tuple(tuple(row) for row in Rotation.from_euler("XYZ", degrees, degrees=True)
                 .as_matrix().tolist())


KINECT_DEFAULT = KinectModel(
    name="default",
    calibration=Calibration(
        depth=CameraModel(width=640, height=480, fx=575.8, fy=575.8, cx=319.5, cy=239.5),
        color=CameraModel(width=640, height=480, fx=525.0, fy=525.0, cx=319.5, cy=239.5),
        depth_to_color=DepthToColor(translation_mm=(-23.0, 0.0, 0.0)),
    ),
    projector_mm=(75.0, 0.0, 0.0),
)
"""What capture assumes of a sensor that knows no calibration: OpenNI's own figures."""

KINECT_CALIBRATED = KinectModel(
    name="calibrated",
    calibration=Calibration(
        depth=CameraModel(width=640, height=480, fx=588.4, fy=587.1, cx=316.9, cy=243.2,
                          distortion=(-0.0842, 0.2236, -0.0011, 0.0007, -0.1413)),
        color=CameraModel(width=640, height=480, fx=521.9, fy=522.6, cx=323.8, cy=250.4,
                          distortion=(0.1873, -0.4812, 0.0012, -0.0016, 0.3891)),
        depth_to_color=DepthToColor(
            rotation=_rotation(-0.31, 0.42, 0.17),
            translation_mm=(-25.1, 0.47, -1.2)),
    ),
    projector_mm=(75.0, 0.0, 0.0),
)
"""One unit calibrated on its own: rotation, distortion in both cameras."""
