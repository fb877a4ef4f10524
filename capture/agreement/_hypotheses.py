"""What may be wrong with a frame: each hypothesis says how the frame would be put right."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from denseface.capture.agreement._outlines import Outlines
from denseface.capture.calibration import CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame

__all__ = ["NO_CORRECTION", "Correction", "hypotheses"]

_LEFT_OUT_MM = 1.0
"""Cameras of a sensor are farther apart than this, mm."""
_USUAL_MM = -23.0
"""Where the colour camera of a PrimeSense sensor stands (DCRCDIS), along x, mm."""


@dataclass(frozen=True)
class Correction:
    """How a frame is put right; by default not at all.

    Attributes
    ----------
    fault : what was wrong, in words; empty where nothing was
    registered : what the frame says instead; None as before
    pose : depth to colour instead; None as before
    turn_color, turn_depth : mirror the image left to right
    likely : how likely it is before anything is measured; of hypotheses that fit alike, the
        likelier one is taken
    """

    fault: str = ""
    registered: bool | None = None
    pose: DepthToColor | None = None
    turn_color: bool = False
    turn_depth: bool = False
    likely: int = 0

    def apply(self, frame: RgbdFrame) -> RgbdFrame:
        """Give the frame as it would be without the fault."""
        if not self.fault:
            return frame
        changes: dict[str, Any] = {}
        if self.registered is not None:
            changes["registered"] = self.registered
        if self.pose is not None:
            changes["calibration"] = frame.calibration.model_copy(
                update={"depth_to_color": self.pose})
        if self.turn_color:
            changes["color"] = np.ascontiguousarray(frame.rgb[:, ::-1])
        if self.turn_depth:
            changes["depth"] = np.ascontiguousarray(frame.depth[:, ::-1])
        return replace(frame, **changes)

    def seen_at(self, outlines: Outlines, frame: RgbdFrame) -> NDArray[np.float64]:
        """Give where the colour image, as it is, would show the outlines: (n, 2) pixels."""
        calibration = frame.calibration
        registered = frame.registered if self.registered is None else self.registered
        pixels = outlines.pixels
        if self.turn_depth:
            pixels = np.stack([frame.depth.shape[1] - 1 - pixels[:, 0], pixels[:, 1]], axis=1)
        camera = calibration.color if registered else calibration.depth
        points = camera.back_project(pixels, outlines.z_mm)
        if not registered:
            points = (self.pose or calibration.depth_to_color).apply(points)
        points[points[:, 2] <= 0] = np.nan
        uv = calibration.color.project(points)
        if self.turn_color:
            uv[:, 0] = calibration.color.width - 1 - uv[:, 0]
        return uv


NO_CORRECTION = Correction()


def hypotheses(frame: RgbdFrame) -> list[Correction]:
    """Give what may be wrong with a frame; the first is that nothing is."""
    calibration = frame.calibration
    found = [NO_CORRECTION]
    if frame.registered and _fits(calibration.depth, frame):
        found.append(Correction("depth is not in the colour camera's pixels, though it is said to "
                                "be", registered=False))
    if not frame.registered and _fits(calibration.color, frame):
        found.append(Correction("depth is in the colour camera's pixels already, though it is not "
                                "said to be", registered=True))
    if not frame.registered:
        found += _poses(calibration.depth_to_color)
    found += [
        Correction("the colour image is mirrored", turn_color=True),
        Correction("the depth image is mirrored", turn_depth=True),
        Correction("both images are mirrored", turn_color=True, turn_depth=True),
    ]
    return found


def _poses(pose: DepthToColor) -> list[Correction]:
    turn = np.array(pose.rotation)
    shift = np.array(pose.translation_mm)
    found = []
    if np.abs(shift).max() < _LEFT_OUT_MM:
        if shift.any():
            found.append(Correction("the pose between the cameras is given in metres",
                                    pose=_pose(turn, 1000 * shift), likely=2))
        found.append(Correction("the pose between the cameras is left out",
                                pose=_pose(turn, np.array((_USUAL_MM, 0, 0))), likely=1))
        return found
    return [
        Correction("the pose between the cameras is the inverse of the right one",
                   pose=_pose(turn.T, -turn.T @ shift)),
        Correction("the shift between the cameras has the wrong sign", pose=_pose(turn, -shift)),
    ]


def _pose(turn: NDArray[np.float64], shift: NDArray[np.float64]) -> DepthToColor:
    return DepthToColor.model_validate(
        {"rotation": turn.tolist(), "translation_mm": shift.tolist()})


def _fits(camera: CameraModel, frame: RgbdFrame) -> bool:
    return frame.depth.shape == (camera.height, camera.width)
