"""Where a face stands and how the sensor is held changes nothing but place and direction."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from denseface.capture.calibration import CameraModel, DepthToColor
from denseface.capture.frame import RgbdFrame
from denseface.recon import Settings
from denseface.recon.face import DenseCloud, Seeds
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.propagation import densify
from denseface.recon.registration import register, sample_colors
from denseface.recon.settings import Neighbors
from denseface.recon.surface import exact_spacing, mean_spacing
from tests.unit.recon.shapes import NOISE

HOW = Settings()


def turned(points: np.ndarray, degrees: float) -> np.ndarray:
    """(n, 3) points turned about the viewing axis."""
    quarters = {0.0: (1, 0), 90.0: (0, 1), 180.0: (-1, 0), 270.0: (0, -1)}
    c, s = quarters.get(degrees, (np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))))
    x, y, z = points.T
    return np.column_stack([c * x - s * y, s * x + c * y, z]).astype(np.float32)


def dense_of(seeds: Seeds) -> DenseCloud:
    """What follows segmentation, as `reconstruct` does it, but with exact neighbours."""
    points = seeds.points
    spacing = exact_spacing(np.ascontiguousarray(points[:, :2]))
    plan = plan_fit(HOW, NOISE, spacing)
    return densify(seeds, surface_of(points, spacing, HOW, plan), spacing, HOW.ratio, plan)


def off(one: DenseCloud, other: DenseCloud) -> np.ndarray:
    """Heights and colours of one cloud less those of another at the same (X, Y), (k, 4)."""
    away, nearest = cKDTree(other.points[:, :2]).query(one.points[:, :2], k=1)
    # Along the nearest point's own tangent plane to the very place.
    step = one.points[:, :2] - other.points[nearest, :2]
    n = other.normals[nearest]
    z = other.points[nearest, 2] - (step * n[:, :2]).sum(axis=1) / n[:, 2]
    near = away < other.grid_step_mm
    assert near.mean() > 0.985  # the rim is drawn on another grid
    rgb = one.colors.astype(int) - other.colors[nearest]
    return np.column_stack([one.points[:, 2] - z, rgb])[near]


@pytest.fixture(scope="module")
def seeds(face):
    """The seeds of a simulated face, every other, for speed."""
    cloud = face.initial
    some = np.arange(0, len(cloud), 2)
    return Seeds(cloud.points[some], cloud.colors[some], np.zeros((len(some), 2), np.int32))


@pytest.fixture(scope="module")
def dense(seeds):
    return dense_of(seeds)


@pytest.mark.parametrize("shift", [(37.25, -18.5, 0), (0, 0, 256), (-400, 300, -128)])
def test_a_shift_moves_every_point(seeds, dense, shift):
    moved = dense_of(replace(seeds, points=seeds.points + np.float32(shift)))
    assert abs(len(moved) - len(dense)) <= 0.002 * len(dense)
    back = replace(moved, points=moved.points - np.float32(shift))
    difference = np.abs(off(back, dense))
    assert np.quantile(difference[:, 0], 0.999) < 0.005
    assert difference[:, 1:].mean() < 0.1


@pytest.mark.parametrize("degrees", [90.0, 180.0, 270.0, 17.0, -45.0])
def test_a_turn_about_the_viewing_axis_turns_the_cloud(seeds, dense, degrees):
    there = dense_of(replace(seeds, points=turned(seeds.points, degrees)))
    assert len(there) == pytest.approx(len(dense), rel=0.02)
    back = replace(there, points=turned(there.points, -degrees % 360),
                   normals=turned(there.normals, -degrees % 360))
    difference = np.abs(off(back, dense))
    assert np.median(difference[:, 0]) < 0.02
    assert np.quantile(difference[:, 0], 0.99) < 0.15  # at 60 degrees most, at the rim
    assert difference[:, 1:].mean() < 2


def turned_frame(frame: RgbdFrame) -> RgbdFrame:
    """The frame of a sensor that lies on its side: both images a quarter turn clockwise."""
    def camera(known: CameraModel) -> CameraModel:
        return CameraModel(width=known.height, height=known.width, fx=known.fy, fy=known.fx,
                           cx=known.height - 1 - known.cy, cy=known.cx)

    known = frame.calibration
    R = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]], float)  # x becomes y, y becomes -x
    rotation = R @ np.array(known.depth_to_color.rotation) @ R.T
    calibration = known.model_copy(update={
        "depth": camera(known.depth), "color": camera(known.color),
        "depth_to_color": DepthToColor(
            rotation=tuple(tuple(row) for row in rotation.tolist()),
            translation_mm=tuple(R @ np.array(known.depth_to_color.translation_mm)))})
    return replace(frame, depth=np.ascontiguousarray(np.rot90(frame.depth, -1)),
                   color=np.ascontiguousarray(np.rot90(frame.rgb, -1)), calibration=calibration)


def test_a_sensor_on_its_side_registers_the_same_points(shot):
    straight, aside = register(shot.frame), register(turned_frame(shot.frame))
    back = partial(np.rot90, k=1)
    np.testing.assert_array_equal(back(aside.valid), straight.valid)
    points = back(aside.points)
    np.testing.assert_allclose(points[..., 2], straight.points[..., 2])
    np.testing.assert_allclose(points[..., 0], -straight.points[..., 1], atol=1e-2)
    np.testing.assert_allclose(points[..., 1], straight.points[..., 0], atol=1e-2)
    # The z-buffer's cells lie otherwise: single points beside an edge may differ.
    both = back(aside.visible) & straight.visible
    assert (back(aside.visible) != straight.visible).mean() < 0.01
    colors = np.abs(back(aside.colors)[both].astype(int) - straight.colors[both])
    assert colors.max() <= 8
    assert colors.mean() < 0.2


def test_sampled_colours_are_the_same_on_its_side(shot, face):
    aside = turned_frame(shot.frame)
    points = face.dense.points[::7]
    straight, seen = sample_colors(shot.frame, register(shot.frame), points)
    colors, seen_aside = sample_colors(aside, register(aside), turned(points, 90.0))
    assert (seen != seen_aside).mean() < 0.01
    assert np.abs(colors[seen].astype(int) - straight[seen]).mean() < 0.2


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 999), focal=st.floats(250, 1200), distance=st.floats(500, 1200),
       missing=st.floats(0, 0.3), noise=st.floats(0, 3), tilt=st.floats(-0.6, 0.6))
def test_three_ways_to_the_spacing_agree_within_a_hundredth(
    seed, focal, distance, missing, noise, tilt
):
    """Of seeds back-projected from any camera's image of a curved, tilted, holed surface."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[-50:50, -40:40].astype(float)
    z = distance * (1 + tilt * u / focal + 0.3 * (u**2 + v**2) / focal**2)
    z += rng.normal(0, 1, z.shape) * noise
    kept = rng.random(z.shape) >= missing
    for row, column in rng.integers(-40, 40, (4, 2)):
        kept &= np.hypot(v - row, u - column) > 6
    points = np.stack([u * z / focal, v * z / focal, z], axis=-1)[kept].astype(np.float32)
    pixels = np.argwhere(kept).astype(np.int32)
    exact = mean_spacing(points, pixels, Neighbors.EXACT)
    assert mean_spacing(points, pixels, Neighbors.LATTICE) == pytest.approx(exact, rel=0.01)
    assert mean_spacing(points, pixels, Neighbors.RANDOMIZED) == pytest.approx(exact, rel=0.01)
