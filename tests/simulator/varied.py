"""Heads that nobody scanned: `load_head("NAME~SEED")` is a head with other proportions.

Of `ict_neutral`, whose model is at hand, it is another person: a draw of the model's identities.
Every other head is stretched along its three axes.
"""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

from tests.simulator.landmarks import Landmarks

__all__ = ["MODEL", "identity", "stretch"]

MODEL = "ict_modes.npz"
"""The face of ICT-FaceKit (MIT): its mean, and what a standard deviation of each identity adds."""
_STRETCH = 0.06
"""Standard deviation of the factors on x, y and z."""
_FADE_MM = 40.0
"""So far from the model's face its displacement has faded to a third."""
_EVERY, _NEIGHBORS = 12, 40
"""Of the face's vertices, which are interpolated between; how many of them for each place."""

Floats = NDArray[np.float32]


def stretch(vertices: Floats, marks: Landmarks, seed: int) -> tuple[Floats, Landmarks]:
    """Stretch a head, (n, 3) mm, with its landmarks."""
    factors = 1 + _STRETCH * np.random.default_rng([41, seed]).standard_normal(3).clip(-2, 2)
    return (vertices * factors).astype(np.float32), _moved(marks, lambda at: at * factors)


def identity(
    vertices: Floats, marks: Landmarks, seed: int, folder: Path
) -> tuple[Floats, Landmarks]:
    """Give another identity of `ict_neutral`'s model, whose first vertices are the face's."""
    with np.load(folder / MODEL, allow_pickle=False) as data:
        modes = data["modes"].astype(np.float64)
    weights = np.random.default_rng([42, seed]).standard_normal(len(modes)).clip(-2, 2)
    moves = np.tensordot(weights, modes, 1)
    face = vertices[:len(moves)].astype(np.float64)
    field = RBFInterpolator(face[::_EVERY], moves[::_EVERY], neighbors=_NEIGHBORS,
                            kernel="linear")
    near = cKDTree(face)

    def displacement(at: NDArray[np.float64]) -> NDArray[np.float64]:
        away = near.query(at)[0]
        return np.asarray(field(at) * np.exp(-away / _FADE_MM)[:, None], np.float64)

    rest = vertices[len(moves):].astype(np.float64)
    out = np.concatenate([face + moves, rest + displacement(rest)])
    return out.astype(np.float32), _moved(marks, lambda at: at + displacement(at[None])[0])


def _moved(
    marks: Landmarks, move: Callable[[NDArray[np.float64]], NDArray[np.floating]]
) -> Landmarks:
    """Move each landmark as the surface near it."""
    def of(y: float, z: float, x: float = 0.0) -> NDArray[np.float64]:
        return np.asarray(move(np.array([x, y, z])), np.float64)

    level = {name: tuple(of(*getattr(marks, name))[1:].tolist())
             for name in ("bridge", "hairline", "chin", "ear_top", "ear_bottom", "nose_tip",
                          "mouth")}
    half, y, z, depth = marks.neck
    ex, ey, ez = marks.eyes
    _, ny, nz = of(y, z).tolist()
    wide = of(y, z, half)[0] / half
    return replace(marks, **level, eyes=tuple(of(ey, ez, ex).tolist()),
                   neck=(half * wide, ny, nz, depth * wide))
