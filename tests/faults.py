"""Faults put into right frames: what sensors, recorders and calibration files do to them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from denseface.capture.calibration import DepthToColor
from denseface.capture.frame import RgbdFrame

__all__ = ["FAULTS", "registered_depth"]


def registered_depth(frame: RgbdFrame) -> RgbdFrame:
    """Move depth into the colour camera's pixels, as sensors do: the nearest wins."""
    calibration = frame.calibration
    height, width = frame.depth.shape
    v, u = np.nonzero(frame.depth)
    points = calibration.depth_to_color.apply(
        calibration.depth.back_project(np.stack([u, v], axis=-1), frame.depth[v, u]))
    uv = np.rint(calibration.color.project(points) + 1e-6).astype(int)
    inside = (uv >= 0).all(axis=1) & (uv < (width, height)).all(axis=1)
    order = np.flatnonzero(inside)[np.argsort(-points[inside, 2], kind="stable")]
    depth = np.zeros_like(frame.depth)
    depth[uv[order, 1], uv[order, 0]] = np.rint(points[order, 2])
    return replace(frame, depth=depth, registered=True)


def _registered_unsaid(frame: RgbdFrame) -> RgbdFrame:
    return replace(registered_depth(frame), registered=False)


def _said_registered(frame: RgbdFrame) -> RgbdFrame:
    return replace(frame, registered=True)


def _pose(change: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
          ) -> Callable[[RgbdFrame], RgbdFrame]:
    def put_in(frame: RgbdFrame) -> RgbdFrame:
        pose = frame.calibration.depth_to_color
        turn, shift = change(np.array(pose.rotation), np.array(pose.translation_mm))
        wrong = DepthToColor.model_validate(
            {"rotation": turn.tolist(), "translation_mm": shift.tolist()})
        return replace(frame, calibration=frame.calibration.model_copy(
            update={"depth_to_color": wrong}))
    return put_in


def _mirrored(*names: str) -> Callable[[RgbdFrame], RgbdFrame]:
    def put_in(frame: RgbdFrame) -> RgbdFrame:
        return replace(frame, **{
            name: np.ascontiguousarray(getattr(frame, name)[:, ::-1]) for name in names})
    return put_in


FAULTS: dict[str, Callable[[RgbdFrame], RgbdFrame]] = {
    "registered, not said": _registered_unsaid,
    "said registered, is not": _said_registered,
    "pose left out": _pose(lambda turn, shift: (0 * turn + np.eye(3), 0 * shift)),
    "pose in metres": _pose(lambda turn, shift: (turn, shift / 1000)),
    "pose inverted": _pose(lambda turn, shift: (turn.T, -turn.T @ shift)),
    "shift of the wrong sign": _pose(lambda turn, shift: (turn, -shift)),
    "colour mirrored": _mirrored("color"),
    "depth mirrored": _mirrored("depth"),
    "both mirrored": _mirrored("color", "depth"),
}
"""Each makes a frame wrong that is right and not registered."""
