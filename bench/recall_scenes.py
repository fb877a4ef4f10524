"""The scenes by which detection is judged: faces with one thing out of the ordinary, and none."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from denseface.capture import RgbdFrame
from denseface.capture.calibration import CameraModel
from denseface.capture.npz import load_frame, save_frame
from tests.simulator import (
    KINECT_CALIBRATED,
    KinectModel,
    Light,
    Person,
    Scene,
    Truth,
    head_names,
    shared_folder,
    simulate,
)

__all__ = ["View", "darkened", "empty_views", "face_views", "real_without_face", "taken"]


_PLAIN = Person(distance_mm=750.0)
_LEFT, _RIGHT, _ABOVE = (-1.0, -0.1, -0.25), (1.0, -0.1, -0.25), (0.1, -1.0, -0.2)
_ALIKE = Light().toward
_LIGHTS = {
    "from the left": Light(_LEFT, 0.75, 0.12), "from the right": Light(_RIGHT, 0.75, 0.12),
    "from above": Light(_ABOVE, 0.75, 0.12), "dim, a quarter": Light(_ALIKE, 0.19, 0.09),
    "dim, a tenth": Light(_ALIKE, 0.075, 0.035), "strong, twice": Light(_ALIKE, 1.5, 0.7),
}
_TURNED_AWAY = (130.0, 230.0)


@dataclass(frozen=True)
class View:
    """One scene; what is out of the ordinary in it."""

    factor: str
    value: str
    scene: Scene
    seed: int
    balls: int = 0
    """So many balls of a head's size and colour hang in the room."""
    mirrored: bool = False
    """The frame is seen in a mirror, cameras included."""
    sensor: KinectModel = KINECT_CALIBRATED

    @property
    def name(self) -> str:
        """For the file that keeps the frame."""
        head = self.scene.people[0].head if self.scene.people else "nobody"
        return f"{self.factor}_{self.value}_{head}_{self.seed}".replace(" ", "-").replace(",", "")


def face_views(heads: tuple[str, ...]) -> Iterator[View]:
    """Every value of every factor, once a head; all else straight, at 0.75 m, in plain light."""
    varied: list[tuple[str, str, Person, Light]] = [("plain", "", _PLAIN, Light())]
    varied += [("yaw", f"{a:+d}", replace(_PLAIN, yaw=float(a)), Light())
               for a in (-60, -45, -30, -15, 15, 30, 45, 60)]
    varied += [("pitch", f"{a:+d}", replace(_PLAIN, pitch=float(a)), Light())
               for a in (-30, -20, -10, 10, 20, 30)]
    varied += [("roll", f"{a:+d}", replace(_PLAIN, roll=float(a)), Light())
               for a in (-40, -30, -20, -10, 10, 20, 30, 40)]
    varied += [("light", name, _PLAIN, light) for name, light in _LIGHTS.items()]
    varied += [("skin", f"x {gain}", replace(_PLAIN, skin_gain=(gain,) * 3), Light())
               for gain in (0.5, 0.25, 0.12)]
    varied += [("distance", f"{mm / 1000:.2f} m", replace(_PLAIN, distance_mm=float(mm)), Light())
               for mm in (500, 600, 1000, 1300, 1550, 1800)]
    varied += [("wearing", "glasses", replace(_PLAIN, glasses=True), Light()),
               ("wearing", "a hand at the cheek", replace(_PLAIN, hand=True), Light())]
    for number, (factor, value, person, light) in enumerate(varied):
        for which, head in enumerate(_known(heads)):
            seed = 100 * number + which
            x, y = np.random.default_rng([3, seed]).uniform((-70, -40), (70, 40))
            there = replace(person, head=head, offset_mm=(float(x), float(y)))
            yield View(factor, value, Scene((there,), light=light, decor=seed), seed)


def empty_views(heads: tuple[str, ...], count: int) -> Iterator[View]:
    """Scenes without a face: rooms, walls, balls, the backs of heads, bodies without a head.

    Each stands there twice, the second time mirrored: to a cascade that is another image.
    """
    for view in _empty_scenes(heads, count // 2):
        yield view
        yield replace(view, mirrored=True)


def _empty_scenes(heads: tuple[str, ...], count: int) -> Iterator[View]:
    for seed in range(count):
        rng = np.random.default_rng([5, len(heads), seed])
        light = list(_LIGHTS.values())[seed // 5 % 6] if seed // 5 % 2 else Light()
        person = Person(head=_known(heads)[seed // 5 % len(_known(heads))],
                        distance_mm=float(rng.uniform(550, 1600)),
                        offset_mm=(float(rng.uniform(-150, 150)), float(rng.uniform(-60, 60))))
        room = Scene((), light=light, decor=10_000 * len(heads) + 17 * seed)
        match seed % 5:
            case 0:
                yield View("empty", "rooms", room, seed)
            case 1:
                wall = float(rng.uniform(500, 2500))
                yield View("empty", "walls", replace(room, wall_mm=wall), seed)
            case 2:
                yield View("empty", "balls", room, seed, balls=int(rng.integers(1, 4)))
            case 3:
                turned = replace(
                    person, yaw=float(rng.uniform(*_TURNED_AWAY)),
                    pitch=float(rng.uniform(-15, 15)), roll=float(rng.uniform(-15, 15)))
                yield View("empty", "backs of heads", replace(room, people=(turned,)), seed)
            case _:
                # Half the view is 0.42 of the distance high, a head reaches 130 mm down.
                up = 0.42 * person.distance_mm + 150.0
                body = replace(person, offset_mm=(person.offset_mm[0], -up), hand=seed % 2 == 0)
                yield View("empty", "bodies without a head", replace(room, people=(body,)), seed)


def taken(view: View, folder: Path | None) -> tuple[RgbdFrame, Truth]:
    """Simulate a view, or read what was kept of it in a folder. The truth is never mirrored."""
    frame, truth = _simulated(view, folder)
    return (_mirrored(frame) if view.mirrored else frame), truth


def darkened(frame: RgbdFrame, light: float, noise: float, seed: int) -> RgbdFrame:
    """Give the frame in so much of its light, with that much more noise in colour, grey levels."""
    share = frame.rgb / 255.0
    linear = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4) * light
    share = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    noisy = 255 * share + np.random.default_rng([7, seed]).normal(0, noise, share.shape)
    return replace(frame, color=np.clip(np.rint(noisy), 0, 255).astype(np.uint8))


def _simulated(view: View, folder: Path | None) -> tuple[RgbdFrame, Truth]:
    kept = folder / f"{view.name}.npz" if folder else None
    truth_path = kept.with_suffix(".truth.npz") if kept else None
    if kept and truth_path and truth_path.exists():
        return load_frame(kept), Truth.load(truth_path)
    shot, = simulate(view.scene, view.sensor, seed=view.seed)
    frame = _with_balls(shot.frame, view) if view.balls else shot.frame
    if kept and truth_path:
        save_frame(frame, kept)
        shot.truth.save(truth_path)
    return frame, shot.truth


def _known(heads: tuple[str, ...]) -> list[str]:
    """The procedural head stands in where no scans are at hand."""
    return [head for head in heads if head in head_names()] or ["procedural"]


def _with_balls(frame: RgbdFrame, view: View) -> RgbdFrame:
    """Hang balls before the room, in both images, lit from above; no shadows, no noise on them."""
    rng = np.random.default_rng([6, view.seed])
    depth, color = frame.depth.copy(), frame.rgb.copy()
    cameras = frame.calibration
    for _ in range(view.balls):
        middle = rng.uniform((-300, -200, 600), (300, 200, 1500))
        radius, skin = rng.uniform(70, 110), rng.uniform((140, 90, 70), (230, 190, 170))
        z, _ = _ball(cameras.depth, middle, radius)
        depth = np.where(z > 0, np.rint(z), depth).astype(np.uint16)
        moved = frame.depth_to_color.apply(middle[None].astype(np.float32))[0]
        z, up = _ball(cameras.color, moved.astype(np.float64), radius)
        shaded = skin * (0.6 + 0.4 * up[..., None])
        color = np.where((z > 0)[..., None], np.rint(shaded), color).astype(np.uint8)
    return replace(frame, depth=depth, color=color)


def _mirrored(frame: RgbdFrame) -> RgbdFrame:
    """Exchange left and right, in images, cameras and the way from one to the other."""
    def seen(camera: CameraModel) -> CameraModel:
        k1, k2, p1, p2, k3 = camera.distortion
        return camera.model_copy(update={
            "cx": camera.width - 1 - camera.cx, "distortion": (k1, k2, p1, -p2, k3)})

    known = frame.calibration
    flip = np.diag((-1.0, 1.0, 1.0))
    x, y, z = known.depth_to_color.translation_mm
    turned = flip @ np.array(known.depth_to_color.rotation) @ flip
    way = known.depth_to_color.model_copy(update={
        "translation_mm": (-x, y, z), "rotation": tuple(map(tuple, turned.tolist()))})
    return replace(
        frame, depth=np.ascontiguousarray(frame.depth[:, ::-1]),
        color=np.ascontiguousarray(frame.rgb[:, ::-1]),
        calibration=known.model_copy(update={
            "depth": seen(known.depth), "color": seen(known.color), "depth_to_color": way}))


def _ball(
    camera: CameraModel, middle: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Depth, zero where a ray misses, and how far the surface looks up, -1 to 1; both (H, W)."""
    rays = np.dstack([camera.rays(), np.ones((camera.height, camera.width))])
    squared = (rays**2).sum(axis=2)
    along = rays @ middle / squared
    inside = along**2 - (middle @ middle - radius**2) / squared
    z = np.where(inside > 0, along - np.sqrt(np.maximum(inside, 0)), 0.0)
    return z, (middle[1] - z * rays[..., 1]) / radius


def real_without_face() -> list[Path]:
    """List the real recordings (`.oni`) and frames (`.npz`) without a face that are at hand."""
    shared = shared_folder()
    if shared is None:
        return []
    return [*sorted((shared / "recordings").glob("*no_face*.oni")),
            *sorted((shared / "reports").glob("*.npz"))]
