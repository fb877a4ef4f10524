"""Errors of dense points on simulated frames, and what their `sigma` is made of."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any
from unittest import mock

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from bench.cases import Case, with_preset
from bench.heads import at_hand
from denseface.capture import RgbdFrame
from denseface.recon import Preset, ReconstructionError, reconstruct
from denseface.recon.face import DenseCloud
from denseface.recon.noise import Risk
from denseface.recon.propagation.uncertainty import (
    VarianceComponents,
    standard_error,
    variance_components,
)
from tests.simulator import Person, Scene, Truth, simulate
from tests.simulator.sensors import SENSORS

__all__ = ["Samples", "frames", "near_rim", "sample"]


_DISTANCES_MM = (600.0, 1100.0)
_YAW = 20.0
"""Largest turn to either side, degrees."""
_HOLES = (0.25, 1.0)
"""`Scene.holes` by turns: traces at eyes and nostrils, large patches."""
_RIM_SPACINGS = 3.0
"""Points nearer to the outline are the rim, mean spacings."""
_POINTS = 8000
"""Points drawn from a frame."""
_HOLE_POINTS = 2000
"""Points in holes drawn besides, at most."""

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Samples:
    """Dense points of some frames.

    Attributes
    ----------
    error : (m,) mm along the viewing ray, signed
    distance : (m,) mm from the true surface; NaN where it was not asked for
    sigma, z : (m,) mm
    components : (m, 7) mm^2, what the coefficients of `recon.propagation.uncertainty` multiply:
        bias, white, smooth, hole, slope, rim, rim_jitter
    hole, rim : (m,) bool
    everywhere : (m,) bool, drawn from all points; the others were added to have enough in holes
    """

    error: Floats
    distance: Floats
    sigma: Floats
    z: Floats
    components: Floats
    hole: NDArray[np.bool_]
    rim: NDArray[np.bool_]
    everywhere: NDArray[np.bool_]

    @classmethod
    def joined(cls, parts: list["Samples"]) -> "Samples":
        """Put frames together."""
        return cls(**{name: np.concatenate([getattr(part, name) for part in parts])
                      for name in cls.__annotations__})


def frames(heads: tuple[str, ...], count: int, seed: int) -> Iterator[tuple[RgbdFrame, Truth]]:
    """Simulate heads and sensors by turns, few and many holes by turns, at random places.

    The procedural head stands in for those that are not at hand.
    """
    known = at_hand(heads)
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        distance, yaw = rng.uniform(*_DISTANCES_MM), rng.uniform(-_YAW, _YAW)
        scene = Scene((Person(known[index % len(known)], distance, yaw=yaw),),
                      holes=_HOLES[(index // len(known)) % 2], decor=index)
        sensor = tuple(SENSORS.values())[index * 5 % len(SENSORS)]
        shot, = simulate(scene, sensor, seed=1000 + index)
        yield shot.frame, shot.truth


@dataclass(frozen=True, eq=False)
class _PlacedComponents:
    """Variance components, (x, y) of their first node, and the distance of nodes, mm."""

    components: VarianceComponents
    origin: tuple[float, float]
    step: float

    def at(self, points: NDArray[np.float32], plan: Risk) -> Floats:
        """Interpolate them at points, (n, 3) to (n, 7)."""
        x, y = ((points[:, axis] - self.origin[axis]) / self.step for axis in (0, 1))
        noise, *rest = (map_coordinates(
            getattr(self.components, name).astype(np.float64), (y, x), order=1, mode="nearest")
            for name in ("noise", "hole", "slope", "rim", "rim_jitter"))
        shares = (plan.bias_share, plan.white_share, plan.smooth_share)
        return np.column_stack([*(share * noise for share in shares), *rest])


def sample(frame: RgbdFrame, truth: Truth, preset: Preset, *, distance: bool) -> Samples | None:
    """Reconstruct a frame and draw some of its points; None where it gives no face."""
    try:
        with _recorded() as (recorded, plans):
            case = Case("", frame, truth, reconstruct(frame, with_preset(preset, beyond=True)))
    except ReconstructionError:
        return None
    dense = case.face.dense
    drawn = np.random.default_rng(0).permutation(len(dense))
    everywhere = np.zeros(len(dense), bool)
    everywhere[drawn[:_POINTS]] = True
    chosen = everywhere.copy()
    chosen[drawn[case.hole[drawn]][:_HOLE_POINTS]] = True
    error = truth.depth_error(dense.points)
    chosen &= np.isfinite(error)
    points = dense.points[chosen]
    return Samples(
        error=error[chosen],
        distance=(truth.surface_distance(points) if distance
                  else np.full(len(points), np.nan)),
        sigma=dense.sigma[chosen].astype(np.float64),
        z=points[:, 2].astype(np.float64),
        components=recorded[-1].at(points, plans[-1]),  # any before are the warm-up's
        hole=case.hole[chosen],
        rim=near_rim(dense, case.spacing)[chosen],
        everywhere=everywhere[chosen],
    )


@contextmanager
def _recorded() -> Iterator[tuple[list[_PlacedComponents], list[Risk]]]:
    """Record what `reconstruct` makes sigma of; it is not in the face."""
    recorded: list[_PlacedComponents] = []
    plans: list[Risk] = []

    def record(*arguments: Any) -> VarianceComponents:
        found = variance_components(*arguments)
        *_, origin, step, _ = arguments
        recorded.append(_PlacedComponents(found, origin, step * found.every))
        return found

    def with_plan(components: VarianceComponents, plan: Risk, **how: bool) -> Any:
        plans.append(plan)
        return standard_error(components, plan, **how)

    place = "denseface.recon.propagation._densify"
    with (mock.patch(f"{place}.variance_components", record),
          mock.patch(f"{place}.standard_error", with_plan)):
        yield recorded, plans


def near_rim(dense: DenseCloud, spacing: float) -> NDArray[np.bool_]:
    """Say which points are near the border of the face; spacing : of its seeds, mm."""
    inside = np.zeros((dense.grid_shape[0] + 2, dense.grid_shape[1] + 2), np.uint8)
    row, column = dense.cells[:, 0] + 1, dense.cells[:, 1] + 1
    inside[row, column] = 1
    away = cv2.distanceTransform(inside, cv2.DIST_L2, 5)[row, column] * dense.grid_step_mm
    return np.asarray(away < _RIM_SPACINGS * spacing)
