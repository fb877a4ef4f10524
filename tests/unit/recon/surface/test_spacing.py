import numpy as np
import pytest

from denseface.recon.settings import Neighbors
from denseface.recon.surface._spacing import (
    exact_spacing,
    lattice_spacing,
    mean_spacing,
    randomized_neighbors,
    randomized_spacing,
)


def face_like(seed: int = 0) -> tuple[np.ndarray, np.ndarray]:
    """Seeds back-projected from a depth image with holes: (n, 3) float32, (n, 2) int32."""
    rng = np.random.default_rng(seed)
    v, u = np.mgrid[:120, :100]
    z = 700 + 0.02 * ((u - 50) ** 2 + (v - 60) ** 2) + rng.normal(0, 1.5, u.shape)
    kept = (np.hypot(u - 50, v - 60) < 48) & (rng.random(u.shape) > 0.05)
    f = 575.8
    points = np.stack([(u - 50) * z / f, (v - 60) * z / f, z], axis=-1)[kept]
    return points.astype(np.float32), np.argwhere(kept).astype(np.int32)


def test_three_ways_agree_within_one_percent():
    points, pixels = face_like()
    exact = mean_spacing(points, pixels, Neighbors.EXACT)
    assert mean_spacing(points, pixels, Neighbors.LATTICE) == pytest.approx(exact, rel=0.01)
    assert mean_spacing(points, pixels, Neighbors.RANDOMIZED) == pytest.approx(exact, rel=0.01)


def test_lattice_equals_the_exact_tree_where_seeds_are_dense():
    points, pixels = face_like(3)
    assert lattice_spacing(points[:, :2], pixels) == pytest.approx(
        exact_spacing(points[:, :2]), rel=1e-4)


def test_a_square_lattice_has_its_pitch():
    xy = np.stack(np.meshgrid(np.arange(30), np.arange(20)), axis=-1).reshape(-1, 2)
    xy = (1.4 * xy).astype(np.float32)
    assert exact_spacing(xy) == pytest.approx(1.4, rel=1e-5)
    assert randomized_spacing(xy) == pytest.approx(1.4, rel=0.01)


def test_isolated_seeds_fall_back_to_the_tree():
    pixels = np.array([[0, 0], [0, 50], [50, 0]], np.int32)
    xy = pixels.astype(np.float32)
    assert lattice_spacing(xy, pixels) == pytest.approx(50)


def test_randomized_recall_grows_with_checks():
    xy = np.ascontiguousarray(face_like(1)[0][:, :2])
    exact = np.argsort(((xy[:300, None] - xy[None]) ** 2).sum(-1), axis=1)[:, :20]

    def recall(checks: int) -> float:
        found, distances = randomized_neighbors(xy, 20, checks)
        assert (np.diff(distances, axis=1) >= -1e-6).all()
        return np.mean([len(set(a) & set(b)) / 20 for a, b in zip(found[:300], exact, strict=True)])

    assert recall(256) > 0.95
    assert recall(256) > recall(16)


def test_one_seed_has_no_spacing():
    with pytest.raises(ValueError, match="at least 2"):
        mean_spacing(np.zeros((1, 3), np.float32), np.zeros((1, 2), np.int32), Neighbors.EXACT)
