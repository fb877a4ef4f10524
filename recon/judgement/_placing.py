"""How the mean face lies on a surface best: many starts, few of them refined."""

import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np

from denseface.recon.arrays import Doubles
from denseface.recon.judgement._mould_kernels import Mould
from denseface.recon.judgement._placing_kernels import refine
from denseface.recon.numerics.percentile import percentile

__all__ = ["mean_face", "mean_face_data", "placements", "quick_placements"]

_YAWS, _ROLLS = np.radians(np.arange(-60.0, 61.0, 20.0)), np.radians((-28.0, 0.0, 28.0))
"""Turns to start from, rad."""
_UPRIGHT, _ALL = slice(1, 2), slice(None)
"""Which of the rolls are tried first, and then."""
_SHIFTS_MM = (-20.0, 0.0, 20.0)
"""How far up or down the face, by the mean face, its part that is seen may lie."""
_FEW, _SOME = 60, 250
"""Points for the search, and for the last steps."""
_EACH, _THEN = 2, 3
"""Starts of each yaw that are refined where the first placement will not do, and how many
placements are given then, for each of two scales."""
_ALIKE_RAD = 0.35
"""Placements that are turned by less from each other are one."""
_FAR_MM, _NEAR_MM = 6.0, 3.0
"""Distances that count little, in the search and in the last steps."""
_HEIGHT_MM, _SCALES = 170.0, (0.65, 1.2)
"""What is cut out of a frame is so high on the mean face; bounds of the scale to start from."""
_OF_A_HEAD, _QUICK = 0.9, 2
"""Scale to start from, and how many placements in any roll, where points are raw: of 171 faces all
but two have a score of 0.3 and more by these three, with a scale of 1.0 all but six."""
_SMALLER = 0.75
"""Where hair, neck and ears were cut out, too, the face is smaller by this."""
_ENDS = (3, 97)
"""Percentiles between which its height is measured."""
_FRONT_MM, _FRONT_PERCENT = 50.0, 2
"""How far behind its front the part of a face reaches by whose middle the mean face is laid on."""
_FACING = 0.25
"""Of the mean face a camera sees what faces it by more (cosine)."""
_CORE_RAD, _CORE_MM = 1.3, 90.0
"""Of the mean face, what a face's region may hold: angle and height, each way."""


@cache
def mean_face_data() -> dict[str, Doubles]:
    """Read the mean face that is shipped: `radius`, `brightness` and `axes` of both.

    `python -m bench.mean_face` makes it of three heads: two of ICT-FaceKit (MIT,
    `LICENSE-ICT-FaceKit.txt`), one of MakeHuman (CC0).
    """
    with np.load(Path(__file__).with_name("mean_face.npz"), allow_pickle=False) as data:
        return dict(data)


@cache
def mean_face() -> Mould:
    """Give the mean face's surface."""
    data = mean_face_data()
    radius = data["radius"].astype(np.float32)
    angle, angle_step, height, height_step, axis = data["axes"].tolist()
    return Mould(radius, math.radians(angle), math.radians(angle_step), height, height_step, axis)


def quick_placements(points: Doubles) -> Iterator[Doubles]:
    """Lay the mean face on raw points about the middle of what may be a head, (n, 3) mm.

    Yields (13,): upright, then in any roll; one scale for all.
    """
    few, some = (points[::max(1, len(points) // count)].copy() for count in (_FEW, _SOME))
    yield from _refined(few, some, _starts_on(few, points, _OF_A_HEAD, 1, _UPRIGHT), 1)
    yield from _refined(few, some, _starts_on(few, points, _OF_A_HEAD, 1), _QUICK)


def placements(points: Doubles) -> Iterator[Doubles]:
    """Lay the mean face on points, (n, 3) mm: from the quickest try to the most thorough.

    Yields (13,), by `_mould_kernels`.
    """
    few, some = (points[::max(1, len(points) // count)].copy() for count in (_FEW, _SOME))
    low, high = (percentile(points[:, 1], percent) for percent in _ENDS)
    scale = min(max((high - low) / _HEIGHT_MM, _SCALES[0]), _SCALES[1])
    yield from _refined(few, some, _starts_on(few, points, scale, 1, _UPRIGHT), 1)
    for factor in (1.0, _SMALLER):
        yield from _refined(few, some, _starts_on(few, points, factor * scale, _EACH), _THEN)


def _front(points: Doubles, scale: float = 1.0) -> Doubles:
    """Give the middle of those of points, (n, 3), that lie a little behind the nearest at most."""
    depth = points[:, 2]
    front = percentile(depth, _FRONT_PERCENT)
    return np.asarray(points[depth < front + scale * _FRONT_MM].mean(axis=0))


def _starts_on(
    few: Doubles, points: Doubles, scale: float, each: int, rolls: slice = _ALL
) -> Doubles:
    """Give so many starts of each yaw, with some of the rolls, that are cheapest after a step."""
    starts = _starts()[:, rolls].reshape(-1, 13).copy()
    starts[:, 9:12] = _front(points, scale) - scale * starts[:, 9:12]
    starts[:, 12] = scale
    costs = refine(mean_face(), few, starts, 1, _FAR_MM).reshape(len(_YAWS), -1)
    best = np.argsort(costs, axis=1, kind="stable")[:, :each]
    return np.asarray(starts[(best + costs.shape[1] * np.arange(len(_YAWS))[:, None]).ravel()])


def _refined(few: Doubles, some: Doubles, tried: Doubles, most: int) -> Iterator[Doubles]:
    """Refine starts on few points, and the best of them that differ on some."""
    costs = refine(mean_face(), few, tried, 4, _FAR_MM)
    given: list[Doubles] = []
    for best in tried[np.argsort(costs, kind="stable")]:
        if any(best[:9] @ other[:9] > 1 + 2 * math.cos(_ALIKE_RAD) for other in given):
            continue
        for far_mm in (_FAR_MM, _NEAR_MM):
            refine(mean_face(), some, best[None], 6, far_mm)
        yield best
        given.append(best)
        if len(given) == most:
            return


@cache
def _starts() -> Doubles:
    """Give (yaws, rolls, shifts, 13): placements with the middle of what is seen for a shift."""
    mould = mean_face()
    angles = mould.first_angle + mould.angle_step * np.arange(mould.radius.shape[1])
    heights = mould.first_height + mould.height_step * np.arange(mould.radius.shape[0])
    angle, height = np.meshgrid(angles, heights)
    places = np.stack([mould.radius * np.sin(angle), height,
                       mould.axis_z - mould.radius * np.cos(angle)], axis=-1)
    normals = np.cross(np.gradient(places, axis=1), np.gradient(places, axis=0))
    normals /= -np.linalg.norm(normals, axis=-1, keepdims=True)
    core = (np.abs(angle) < _CORE_RAD) & (np.abs(height) < _CORE_MM)
    rows = []
    for yaw in _YAWS:
        for roll in _ROLLS:
            turn = _about_z(roll) @ _about_y(-yaw)
            seen = places[core & ((normals @ turn.T)[..., 2] < -_FACING)]
            middle = _front(seen @ turn.T)
            rows += [[*turn.ravel(), *(middle - turn @ (0, shift, 0)), 1.0]
                     for shift in _SHIFTS_MM]
    return np.array(rows).reshape(len(_YAWS), len(_ROLLS), len(_SHIFTS_MM), 13)


def _about_y(angle: float) -> Doubles:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def _about_z(angle: float) -> Doubles:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
