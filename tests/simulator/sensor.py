"""From a scene to frames: the sensor as a program would see it, and the truth."""

from dataclasses import dataclass

import numpy as np

from denseface.capture.frame import RgbdFrame
from tests.simulator.camera_views import color_view, depth_view
from tests.simulator.heads import load_head
from tests.simulator.holes import hole_share
from tests.simulator.kinect import KINECT_CALIBRATED, KINECT_DEFAULT, KinectModel
from tests.simulator.noise import noisy_depth
from tests.simulator.scene import Scene
from tests.simulator.truth import Truth

__all__ = ["KINECT_CALIBRATED", "KINECT_DEFAULT", "KinectModel", "Simulated", "simulate"]

_COLOR_NOISE = 2.5
"""Standard deviation, of 255."""
_PERIOD_US = 33_333
_SKEW_US = 11_700
"""As measured on a real recording."""


@dataclass(frozen=True, eq=False)
class Simulated:
    """One frame and what it is a frame of."""

    frame: RgbdFrame
    truth: Truth


def simulate(
    scene: Scene, sensor: KinectModel = KINECT_DEFAULT, seed: int = 0, frames: int = 1
) -> list[Simulated]:
    """Take frames of a still scene.

    Parameters
    ----------
    scene : what is there
    sensor : what it is seen with
    seed : the same seed gives the same frames, byte for byte
    frames : how many; noise alone differs between them
    """
    view = depth_view(scene, sensor)
    clean = color_view(scene, sensor)
    truth = Truth.of(view)
    marks = load_head(scene.people[scene.target].head).landmarks if scene.people else None
    share = hole_share(view, marks, scene.holes, np.random.default_rng([seed, 0]))
    taken = []
    for index in range(frames):
        changing = np.random.default_rng([seed, 2, index])
        depth = noisy_depth(view, share, np.random.default_rng([seed, 1]), changing, sensor.noise)
        color = clean + _COLOR_NOISE * changing.standard_normal(clean.shape, dtype=np.float32)
        taken.append(Simulated(
            frame=RgbdFrame(
                depth=depth, color=np.clip(np.rint(color), 0, 255).astype(np.uint8),
                depth_timestamp_us=1_000_000 + index * _PERIOD_US + _SKEW_US,
                color_timestamp_us=1_000_000 + index * _PERIOD_US,
                calibration=sensor.calibration,
                calibration_origin=f"simulated sensor {sensor.name}",
                depth_meaning=sensor.noise.meaning,
            ),
            truth=truth,
        ))
    return taken
