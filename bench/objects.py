"""Things that are no faces, as signed distances, and what a camera sees of them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from denseface.capture.calibration import CameraModel

__all__ = ["KINDS", "Seen", "Thing", "make_thing", "seen_by"]

Doubles = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Solid = Callable[[Doubles], Doubles]
"""Points, (n, 3) mm in the thing's own frame (y down, its front toward -z), to distances, (n,)."""

_STEPS, _NEAR_MM = 40, 0.3
"""Most steps along a ray, and what counts as there."""


@dataclass(frozen=True, eq=False)
class Thing:
    """One thing, where it stands, and what is painted on it.

    Attributes
    ----------
    kind : its name, one of `KINDS`
    solid : its shape
    radius_mm : of a ball around it
    rotation : (3, 3), from its frame to the depth camera's
    middle_mm : (3,), its middle in that frame
    texture : (h, w, 3) uint8, RGB, laid around or onto it
    wrapped : the texture goes around it, else onto its front
    toward : (3,), unit, to the lamp
    """

    kind: str
    solid: Solid
    radius_mm: float
    rotation: Doubles
    middle_mm: Doubles
    texture: Bytes
    wrapped: bool
    toward: Doubles


@dataclass(frozen=True, eq=False)
class Seen:
    """What a camera sees of a thing: (H, W) float64 depth, mm, 0 beside it; (H, W, 3) RGB."""

    depth: Doubles
    color: Bytes
    facing: Doubles
    """(H, W), cosine between the surface's normal and the ray."""


def _box(half: Sequence[float], rounding: float = 2.0) -> Solid:
    sides = np.asarray(half) - rounding

    def distance(p: Doubles) -> Doubles:
        q = np.abs(p) - sides
        outside = np.sqrt((np.maximum(q, 0) ** 2).sum(axis=1))
        return np.asarray(outside + np.minimum(q.max(axis=1), 0) - rounding)
    return distance


def _ellipsoid(half: Sequence[float], middle: Sequence[float] = (0, 0, 0)) -> Solid:
    sides, at = np.asarray(half, float), np.asarray(middle, float)

    def distance(p: Doubles) -> Doubles:
        q = (p - at) / sides
        k = np.sqrt((q**2).sum(axis=1))
        return np.asarray(k * (k - 1) / np.maximum(np.sqrt(((q / sides) ** 2).sum(axis=1)), 1e-9))
    return distance


def _capsule(start: Sequence[float], end: Sequence[float], radius: float) -> Solid:
    a, way = np.asarray(start, float), np.asarray(end, float) - np.asarray(start, float)

    def distance(p: Doubles) -> Doubles:
        along = np.clip((p - a) @ way / (way @ way), 0, 1)
        return np.asarray(np.sqrt(((p - a - along[:, None] * way) ** 2).sum(axis=1)) - radius)
    return distance


def _turned(heights: Sequence[float], radii: Sequence[float]) -> Solid:
    """Give what a lathe makes: a radius for each height, closed at both ends."""
    ys, rs = np.asarray(heights, float), np.asarray(radii, float)
    steepest = np.abs(np.diff(rs) / np.diff(ys)).max()
    slower = 1 / math.hypot(1, steepest)

    def distance(p: Doubles) -> Doubles:
        side = (np.hypot(p[:, 0], p[:, 2]) - np.interp(p[:, 1], ys, rs)) * slower
        return np.asarray(np.maximum(side, np.maximum(ys[0] - p[:, 1], p[:, 1] - ys[-1])))
    return distance


def _ring(middle: Sequence[float], radius: float, thick: float) -> Solid:
    """Give a ring in the plane of x and y: a handle."""
    at = np.asarray(middle, float)

    def distance(p: Doubles) -> Doubles:
        q = p - at
        return np.asarray(np.hypot(np.hypot(q[:, 0], q[:, 1]) - radius, q[:, 2]) - thick)
    return distance


def _joined(parts: Sequence[Solid], blend: float = 0.0) -> Solid:
    """Unite solids; `blend`, mm, rounds where they meet."""
    def distance(p: Doubles) -> Doubles:
        found = parts[0](p)
        for part in parts[1:]:
            other = part(p)
            if blend:
                h = np.maximum(blend - np.abs(found - other), 0) / blend
                found = np.minimum(found, other) - h * h * blend / 4
            else:
                found = np.minimum(found, other)
        return found
    return distance


def _rough(solid: Solid, rng: np.random.Generator, mm: float, length: float) -> Solid:
    """Dent a solid by a few waves of a height and a length, mm."""
    waves = rng.normal(size=(5, 3))
    waves *= 2 * math.pi / (length * np.linalg.norm(waves, axis=1, keepdims=True))
    phases = rng.uniform(0, 2 * math.pi, 5)

    def distance(p: Doubles) -> Doubles:
        return np.asarray(0.6 * (solid(p) + mm * np.sin(p @ waves.T + phases).mean(axis=1) * 2))
    return distance


def _tin(rng: np.random.Generator) -> tuple[Solid, float]:
    r, h = rng.uniform(32, 80), rng.uniform(40, 120)
    return _turned((-h, -h + 3, -h + 4, h - 4, h - 3, h), (r + 1, r + 1, r, r, r + 1, r + 1)), h + r


def _carton(rng: np.random.Generator) -> tuple[Solid, float]:
    half = rng.uniform((45, 70, 18), (120, 160, 60))
    return _box(half), float(np.linalg.norm(half))


def _ball(rng: np.random.Generator) -> tuple[Solid, float]:
    r = float(rng.uniform(55, 130))
    return _ellipsoid((r, r * rng.uniform(0.8, 1.3), r)), 1.3 * r


def _bottle(rng: np.random.Generator) -> tuple[Solid, float]:
    r, h = rng.uniform(30, 75), rng.uniform(80, 150)
    neck, shoulder = rng.uniform(0.2, 0.6) * r, rng.uniform(0.1, 0.6) * h
    return _turned((-h, -h + 0.25 * h, -h + 0.25 * h + shoulder, h), (neck, neck, r, r)), h + r


def _mug(rng: np.random.Generator) -> tuple[Solid, float]:
    r, h = rng.uniform(35, 70), rng.uniform(45, 90)
    side = float(rng.choice((-1, 1)))
    handle = _ring((side * r, 0, 0), 0.6 * h, 7.0)
    return _joined([_turned((-h, h), (r, r * rng.uniform(0.7, 1.0))), handle], 4.0), 2 * (h + r)


def _book(rng: np.random.Generator) -> tuple[Solid, float]:
    half = rng.uniform((60, 85, 4), (115, 160, 25))
    return _box(half, 1.0), float(np.linalg.norm(half))


def _lamp(rng: np.random.Generator) -> tuple[Solid, float]:
    wide, narrow, h = rng.uniform(70, 130), rng.uniform(30, 70), rng.uniform(50, 100)
    stem = _capsule((0, h, 0), (0, h + 150, 0), 10.0)
    return _joined([_turned((-h, h), (narrow, wide)), stem]), h + 160


def _hand(rng: np.random.Generator) -> tuple[Solid, float]:
    parts = [_box((42, 48, 14), 12.0)]
    for at, long, spread in ((-32, 72, -0.25), (-11, 84, -0.08), (11, 80, 0.06), (32, 62, 0.22)):
        curl = rng.uniform(-0.7, 0.2)
        way = np.array([spread * rng.uniform(0.4, 1.4), -math.cos(curl), math.sin(curl)])
        parts.append(_capsule((at, -44, 0), np.array([at, -44, 0]) + long * way, 9.0))
    parts.append(_capsule((-40, 15, -4), (-75, -25, -25 * rng.uniform(0, 1)), 10.5))
    parts.append(_capsule((0, 40, 0), (0, 180, 0), 27.0))
    return _joined(parts, 8.0), 215.0


def _head(rng: np.random.Generator) -> tuple[Solid, float]:
    """Give the back of a head, with ears and neck, and hair."""
    size = rng.uniform(0.8, 1.1)
    half = size * np.array([76, 112, 96]) * rng.uniform(0.94, 1.06, 3)
    parts = [_ellipsoid(half), _capsule((0, 60 * size, 30), (0, 190 * size, 30), 55 * size)]
    parts += [_ellipsoid((9, 30, 17), (side * half[0], 8, 25)) for side in (-1, 1)]
    if rng.random() < 0.3:
        parts.append(_ellipsoid((32, 36, 40), (0, -10, -half[2])))  # a bun, a tail
    return _rough(_joined(parts, 15.0), rng, rng.uniform(0, 4), rng.uniform(20, 60)), 270.0


def _lumps(rng: np.random.Generator) -> tuple[Solid, float]:
    """Give a soft toy, a fruit bowl, a bag: a few ellipsoids grown together."""
    parts = [_ellipsoid(rng.uniform(45, 90, 3))]
    parts += [_ellipsoid(rng.uniform(14, 55, 3), rng.uniform((-70, -90, -70), (70, 90, 20)))
              for _ in range(rng.integers(1, 6))]
    return _joined(parts, float(rng.uniform(5, 30))), 170.0


def _cloth(rng: np.random.Generator) -> tuple[Solid, float]:
    """Give a heap of cloth: a flat ellipsoid with folds."""
    body = _ellipsoid(rng.uniform((70, 90, 30), (130, 140, 80)))
    return _rough(body, rng, rng.uniform(3, 14), rng.uniform(40, 120)), 170.0


_SHAPES: dict[str, Callable[[np.random.Generator], tuple[Solid, float]]] = {
    "tin": _tin, "carton": _carton, "ball": _ball, "bottle": _bottle, "mug": _mug, "book": _book,
    "lamp": _lamp, "hand": _hand, "back of a head": _head, "lumps": _lumps, "cloth": _cloth,
    "printed card": _book, "printed tin": _tin,
}
KINDS = tuple(_SHAPES)
"""Names of the kinds of things."""
_PRINTED = ("printed card", "printed tin")
_FLAT = ("carton", "book", "printed card", "cloth", "hand")


def make_thing(
    kind: str, rng: np.random.Generator, textures: Sequence[Bytes], faces: Sequence[Bytes],
    middle_mm: Doubles,
) -> Thing:
    """Make one thing.

    Parameters
    ----------
    kind : one of `KINDS`
    textures, faces : pictures, RGB, that are laid on things; faces on what is printed
    middle_mm : (3,), where it stands, depth camera's frame
    """
    solid, radius = _SHAPES[kind](rng)
    printed = kind in _PRINTED
    whole = (faces if printed else textures)[rng.integers(len(faces if printed else textures))]
    texture = whole if printed else _patch(whole, rng)
    most = (12, 25, 8) if printed else (30, 60, 25)
    turn = rng.uniform(-1, 1, 3) * most
    return Thing(kind, solid, radius,
                 np.asarray(Rotation.from_euler("XYZ", turn, degrees=True).as_matrix()),
                 middle_mm, texture, kind not in _FLAT, _unit(rng.uniform((-1, -1, -1.5),
                                                                          (1, 0.2, -0.3))))


def _patch(picture: Bytes, rng: np.random.Generator) -> Bytes:
    """Cut a patch out of a picture."""
    rows, columns = picture.shape[:2]
    h, w = (int(rng.uniform(0.2, 0.6) * side) for side in (rows, columns))
    y, x = rng.integers(rows - h), rng.integers(columns - w)
    return picture[y:y + h, x:x + w]


def _unit(vector: Doubles) -> Doubles:
    return vector / np.linalg.norm(vector)


def seen_by(camera: CameraModel, thing: Thing, way: tuple[Doubles, Doubles]) -> Seen:
    """Cast a camera's rays at a thing.

    way : rotation and translation, mm, from the depth camera's frame to this camera's
    """
    rotation, shift = way[0] @ thing.rotation, way[0] @ thing.middle_mm + way[1]
    rays = camera.rays().reshape(camera.height, camera.width, 2)
    z = max(shift[2], 1.0)
    reach = 1.15 * thing.radius_mm / z
    at = np.flatnonzero((np.abs(rays - shift[:2] / z) < reach).all(axis=2))
    ways = np.column_stack([rays.reshape(-1, 2)[at], np.ones(len(at))])
    own = ways @ rotation
    origin = -shift @ rotation
    along, found = _cast(thing, origin, own, max(z - thing.radius_mm, 50.0))
    depth, facing = np.zeros(camera.height * camera.width), np.zeros(camera.height * camera.width)
    color = np.zeros((camera.height * camera.width, 3), np.uint8)
    at, own, along = at[found], own[found], along[found]
    points = origin + along[:, None] * own
    normals = _normals(thing.solid, points)
    depth[at] = along
    facing[at] = -(normals * own).sum(axis=1) / np.linalg.norm(own, axis=1)
    light = 0.4 + 0.6 * np.maximum(normals @ (thing.rotation.T @ thing.toward), 0)
    color[at] = np.clip(_painted(thing, points) * light[:, None], 0, 255)
    shape = (camera.height, camera.width)
    return Seen(depth.reshape(shape), color.reshape(*shape, 3), facing.reshape(shape))


def _cast(
    thing: Thing, origin: Doubles, rays: Doubles, start: float
) -> tuple[Doubles, NDArray[np.bool_]]:
    """March along rays: how far each comes, by its own length, and whether it meets the thing."""
    along = np.full(len(rays), start)
    lengths = np.linalg.norm(rays, axis=1)
    left, met = np.arange(len(rays)), np.zeros(len(rays), np.bool_)
    for _ in range(_STEPS):
        distance = thing.solid(origin + along[left, None] * rays[left])
        along[left] += distance / lengths[left]
        there = distance < _NEAR_MM
        met[left[there]] = True
        left = left[~there & (along[left] < start + 2.5 * thing.radius_mm)]
        if not len(left):
            break
    return along, met


def _normals(solid: Solid, points: Doubles) -> Doubles:
    steps = np.eye(3)
    slope = np.column_stack([solid(points + step) - solid(points - step) for step in steps])
    return np.asarray(slope / np.maximum(np.linalg.norm(slope, axis=1, keepdims=True), 1e-9))


def _painted(thing: Thing, points: Doubles) -> Doubles:
    """Look points up in the thing's texture, (n, 3)."""
    x, y, z = points.T
    half = np.percentile(np.abs(points), 98, axis=0) + 1e-6 if len(points) else np.ones(3)
    across = x / half[0] / 2 + 0.5
    if thing.wrapped:  # a printed face goes around half of it
        across = np.arctan2(x, -z) / math.pi / (1 if thing.kind in _PRINTED else 2) + 0.5
    down = y / half[1] / 2 + 0.5
    h, w = thing.texture.shape[:2]
    u = np.clip(across * (w - 1), 0, w - 1).astype(np.float32)
    v = np.clip(down * (h - 1), 0, h - 1).astype(np.float32)
    if not len(u):
        return np.zeros((0, 3))
    # A row of more pixels than that is more than remap takes.
    rows = -(-len(u) // 1000)
    padded = [np.resize(one, rows * 1000).reshape(rows, 1000) for one in (u, v)]
    looked = cv2.remap(thing.texture, padded[0], padded[1], cv2.INTER_LINEAR,
                       borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(looked.reshape(-1, 3)[:len(u)], np.float64)
