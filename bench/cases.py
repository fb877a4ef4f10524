"""The frames that the benchmarks run on: seeds, places to evaluate, and the true surface."""

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.accuracy import RECORDINGS
from bench.heads import REPORTING, at_hand
from denseface.capture import RgbdFrame, open_source
from denseface.recon import Neighbors, Preset, ReconstructionError, Settings, reconstruct
from denseface.recon.face import Face
from tests.simulator import KINECT_CALIBRATED, Person, Scene, Truth, simulate

__all__ = ["HOLE_SPACINGS", "Case", "posed", "recorded", "simulated", "with_preset"]

HOLE_SPACINGS = 2.0
"""A point farther than this many mean spacings from every seed, over (X, Y), is inside a hole."""

_DISTANCES_MM = (600.0, 1100.0)
_YAW = 20.0
"""Largest turn to either side, degrees."""


@dataclass(frozen=True, eq=False)
class Case:
    """One frame, segmented once: every method gets these seeds and these places.

    Attributes
    ----------
    name : the recording, or the simulated scene
    frame : the frame
    truth : its true surface
    face : our face, `best` preset unless another was asked for
    """

    name: str
    frame: RgbdFrame
    truth: Truth
    face: Face

    @property
    def seeds(self) -> NDArray[np.float64]:
        """The initial cloud, (n, 3) float64, mm, depth camera frame."""
        return self.face.initial.points.astype(np.float64)

    @property
    def spacing(self) -> float:
        """Mean spacing of the seeds, mm."""
        return self.face.report.mean_spacing_mm

    @property
    def queries(self) -> NDArray[np.float64]:
        """Where every method is evaluated: (X, Y) of our dense cloud, (m, 2) float64, mm."""
        return self.face.dense.points[:, :2].astype(np.float64)

    @cached_property
    def hole(self) -> NDArray[np.bool_]:
        """Which queries are inside holes, (m,) bool."""
        distance, _ = cKDTree(self.seeds[:, :2]).query(self.queries)
        return np.asarray(distance > HOLE_SPACINGS * self.spacing)

    @cached_property
    def pixels(self) -> NDArray[np.float64]:
        """Where the depth camera sees our dense points, (m, 2) float64, pixels (u, v)."""
        return self.frame.depth_camera.project(self.face.dense.points)

    @cached_property
    def seed_pixels(self) -> NDArray[np.int64]:
        """Give (row, column) of each seed in the depth image, (n, 2)."""
        places: NDArray[np.int64] = np.rint(
            self.frame.depth_camera.project(self.face.initial.points)[:, ::-1]).astype(np.int64)
        return places

    def errors(self, points: NDArray[np.floating]) -> NDArray[np.float64]:
        """Distance of points from the true surface, (k, 3) to (k,) mm; NaN stays NaN."""
        found = np.full(len(points), np.nan)
        known = np.isfinite(points).all(axis=1)
        found[known] = self.truth.surface_distance(points[known])
        return found

    def at(self, z: NDArray[np.floating]) -> NDArray[np.float64]:
        """Heights at the queries to points, (m,) to (m, 3)."""
        return np.column_stack([self.queries, z])


def with_preset(preset: Preset, *, beyond: bool = False) -> Settings:
    """Give a preset that works on the very seeds and grid of `Case`, whatever its own.

    beyond : with the points past the outline where it adds some, which no peer has
    """
    known = Settings.of(preset, neighbors=Neighbors.LATTICE)
    return known if beyond else known.model_copy(update={"prior": False})


def recorded(frames: int) -> Iterator[Case]:
    """Give the first frames of every recording whose true surface is known."""
    for path in sorted(RECORDINGS.glob("*.truth.npz")):
        name = path.name.removesuffix(".truth.npz")
        truth = Truth.load(path)
        with open_source(str(RECORDINGS / f"{name}.oni")) as source:
            for index, frame in enumerate(source):
                if index < frames:
                    yield _case(f"{name}/{index}", frame, truth)


def simulated(count: int) -> Iterator[Case]:
    """Give frames of heads at random distances and turns, all with many holes."""
    heads = at_hand(REPORTING)
    for index in range(count):
        rng = np.random.default_rng([7, index])
        head = heads[index % len(heads)]
        distance, yaw = rng.uniform(*_DISTANCES_MM), rng.uniform(-_YAW, _YAW)
        case = posed(head, distance, yaw, 1.0, 100 + index)
        if case is not None:
            yield case


def posed(
    head: str, distance: float, yaw: float, holes: float, seed: int,
    preset: Preset = Preset.BEST, *, beyond: bool = False,
) -> Case | None:
    """Simulate one head at a distance, mm, turned by degrees; None, and a line, where it fails.

    holes : `Scene.holes`; seed : of noise, holes and the wall's pattern, at least 100
    beyond : as of `with_preset`
    """
    scene = Scene((Person(head, distance, yaw=yaw),), holes=holes, decor=seed - 100)
    shot, = simulate(scene, KINECT_CALIBRATED, seed=seed)
    name = f"{head} {distance:.0f} mm {yaw:+.0f} deg"
    try:
        return _case(name, shot.frame, shot.truth, preset, beyond=beyond)
    except ReconstructionError as error:
        print(f"{name} is left out: {error}", file=sys.stderr)
        return None


def _case(
    name: str, frame: RgbdFrame, truth: Truth, preset: Preset = Preset.BEST, *,
    beyond: bool = False,
) -> Case:
    return Case(name, frame, truth, reconstruct(frame, with_preset(preset, beyond=beyond)))
