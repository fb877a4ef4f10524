"""The scenes by which detection's time is judged: each kind varies in all else, as visitors do."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from bench.accuracy import RECORDINGS
from bench.heads import at_hand
from bench.recall_scenes import View, empty_views, real_without_face, taken
from denseface.capture import RgbdFrame, open_source
from denseface.capture.npz import load_frame
from tests.simulator import Light, Person, Scene

__all__ = ["Seen", "seen_frames"]

_PLAIN = Light()
_AGAINST = Light((0.3, -0.5, 1.0), intensity=1.6, ambient=0.06)
_DIM = Light(intensity=0.1, ambient=0.05)
_BESIDE = Light((1.0, -0.1, -0.25), 0.75, 0.12)
_TEXTURE_MM = 250.0
"""What is farther behind the nearest face than this is painted over."""


@dataclass(frozen=True)
class Seen:
    """One frame, of which kind it is, and whether there is a face in it."""

    kind: str
    frame: RgbdFrame
    face: bool


@dataclass(frozen=True)
class _Kind:
    """How a kind of scene departs from a visitor at 0.5-1.3 m in a furnished room."""

    name: str
    person: Callable[[np.random.Generator], dict[str, object]] = lambda _: {}
    light: Light = _PLAIN
    wall_mm: float | None = None
    other: bool = False
    """Another head stands beside, 20-300 mm farther away."""
    spoilt: Callable[[RgbdFrame, np.random.Generator], RgbdFrame] = lambda frame, _: frame


def _textured(frame: RgbdFrame, rng: np.random.Generator) -> RgbdFrame:
    """Paint all that is behind the face with blots and stripes of every size, full of contrast."""
    depth = frame.depth
    near = (depth > 0) & (depth < np.percentile(depth[depth > 0], 2) + _TEXTURE_MM)
    kept = cv2.dilate(near.astype(np.uint8), np.ones((25, 25), np.uint8)) > 0
    height, width = frame.rgb.shape[:2]
    paint = np.zeros((height, width, 3), np.float32)
    for cells in (20, 40, 80, 160):
        blots = rng.normal(size=(cells * 3 // 4, cells, 3)).astype(np.float32)
        paint += cv2.resize(blots, (width, height), interpolation=cv2.INTER_CUBIC)
    color = np.where(kept[..., None], frame.rgb, np.clip(128 + 55 * paint, 0, 255))
    return replace(frame, color=color.astype(np.uint8))


def _noisier(frame: RgbdFrame, rng: np.random.Generator, mm: float, pixels: float, step: int
             ) -> RgbdFrame:
    """Add noise along the ray, alike over so many pixels, growing as depth squared; then round."""
    depth = frame.depth.astype(np.float32)
    noise = rng.normal(size=depth.shape).astype(np.float32)
    if pixels > 0:
        noise = cv2.GaussianBlur(noise, (0, 0), pixels)
        noise /= noise.std()
    noisy = np.rint((depth + mm * (depth / 1000) ** 2 * noise) / step) * step
    return replace(frame, depth=np.where(depth > 0, np.maximum(noisy, 1), 0).astype(np.uint16))


def _tipped(rng: np.random.Generator) -> dict[str, object]:
    return {"roll": float(rng.uniform(20, 40) * rng.choice((-1, 1)))}


_KINDS = (
    _Kind("a face at 0.5-1.3 m, turned to 20 degrees"),
    _Kind("the same at 1.1 m", lambda _: {"distance_mm": 1100.0}),
    _Kind("before a textured background, 1.1 m", lambda _: {"distance_mm": 1100.0},
          spoilt=_textured),
    _Kind("before a textured background", spoilt=_textured),
    _Kind("before a wall 0.3 m behind", lambda _: {"distance_mm": 800.0}, wall_mm=1250.0,
          spoilt=_textured),
    _Kind("turned by 35-60 degrees",
          lambda rng: {"yaw": float(rng.uniform(35, 60) * rng.choice((-1, 1)))}),
    _Kind("tipped by 20-40 degrees", _tipped),
    _Kind("lit from the side", light=_BESIDE),
    _Kind("dim, a seventh", light=_DIM),
    _Kind("dim and tipped, dark skin", lambda rng: _tipped(rng) | {"skin_gain": (0.15,) * 3},
          light=_DIM),
    _Kind("against the light", light=_AGAINST),
    _Kind("with a hand at the cheek", lambda _: {"hand": True}),
    _Kind("two people", other=True),
    _Kind("a child's head, 0.8 of the size", lambda _: {"scale": 0.8}),
    _Kind("white noise, 2 mm at 1 m", spoilt=partial(_noisier, mm=2.0, pixels=0.0, step=1)),
    _Kind("noise alike over 4 pixels, 3 mm", spoilt=partial(_noisier, mm=3.0, pixels=4.0, step=1)),
    _Kind("depth in steps of 8 mm", spoilt=partial(_noisier, mm=1.0, pixels=0.0, step=8)),
)


def seen_frames(heads: tuple[str, ...], count: int, folder: Path | None) -> Iterator[Seen]:
    """Give so many frames of each simulated kind, then what was recorded and what has no face.

    folder : keeps the simulated frames, and gives them the next time
    """
    for path in sorted(RECORDINGS.glob("*.truth.npz")):
        name = path.name.removesuffix(".truth.npz")
        yield from _recorded(RECORDINGS / f"{name}.oni", "recordings of a face", face=True)
    for number, kind in enumerate(_KINDS):
        for which in range(count):
            seed = 10_000 * len(heads) + 100 * number + which
            rng = np.random.default_rng([8, seed])
            view = View("detection", f"{number}", _scene(kind, heads, which, rng), seed)
            yield Seen(kind.name, kind.spoilt(taken(view, folder)[0], rng), face=True)
    for view in empty_views(heads, 10 * count):
        yield Seen(f"no face: {view.value}", taken(view, folder)[0], face=False)
    yield from _recorded(RECORDINGS / "empty_room.oni", "no face: recorded rooms", face=False)
    for path in real_without_face():
        if path.suffix == ".npz":
            yield Seen("no face: recorded tables", load_frame(path), face=False)
        else:
            yield from _recorded(path, "no face: recorded rooms", face=False)


def _recorded(path: Path, kind: str, *, face: bool) -> Iterator[Seen]:
    with open_source(str(path)) as source:
        for index, frame in enumerate(source):
            if index < 3:
                yield Seen(kind, frame, face=face)


def _scene(
    kind: _Kind, heads: tuple[str, ...], which: int, rng: np.random.Generator
) -> Scene:
    heads = tuple(at_hand(heads))
    settings: dict[str, object] = {
        "head": heads[which % len(heads)], "distance_mm": float(rng.uniform(500, 1300)),
        "yaw": float(rng.uniform(-20, 20)), "pitch": float(rng.uniform(-12, 12)),
        "roll": float(rng.uniform(-8, 8)), "offset_mm": _offset(rng),
        "skin_gain": (float(rng.uniform(0.3, 1)),) * 3} | kind.person(rng)
    one = Person(**settings)  # type: ignore[arg-type]
    people: tuple[Person, ...] = (one,)
    if kind.other:
        x, y = one.offset_mm
        people = (one, replace(
            one, head=heads[(which + 1) % len(heads)], yaw=0.0, roll=0.0,
            distance_mm=one.distance_mm + float(rng.uniform(20, 300)),
            offset_mm=(x + float(rng.choice((-1, 1)) * rng.uniform(200, 280)), y)))
    return Scene(people, wall_mm=kind.wall_mm, light=kind.light, decor=int(rng.integers(10_000)))


def _offset(rng: np.random.Generator) -> tuple[float, float]:
    x, y = rng.uniform((-90, -50), (90, 50))
    return float(x), float(y)
