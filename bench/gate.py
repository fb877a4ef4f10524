"""What each thing that the quality gate measures does to the reconstruction's error.

.venv/bin/python -m bench.gate [SECTION ...]

Sections: distance, turn, tilt, center, coverage, motion, blur, dark, bright, time. Each changes one
thing of a scene with one head at 0.75 m, and says what the gate measures of it and how far the face
of preset `best` is from the true surface. Heads are those that settings are chosen on.
"""

import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.accuracy import RECORDINGS
from bench.heads import CHOOSING, at_hand
from denseface.capture import RgbdFrame, open_source
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.quality import FaceQuality, Quality, measure
from tests.simulator import (
    KINECT_CALIBRATED,
    Light,
    Person,
    Scene,
    Truth,
    simulate,
)
from tests.simulator import measure as compare
from tests.simulator.accuracy import NEAR_MM

__all__: list[str] = []

_HEADS = 2
_SEED = 3
_AT_MM = 750.0
_SKEW_SHARE = 0.35
"""Of a frame's period, from the colour's exposure to the depth's: 11.7 ms on a real Kinect v1."""
_EXPOSURES = 3
"""Images of which one of a moving face is made."""
_MEASUREMENTS = 12
"""Of a still scene: until each pass of the search had its turn."""
_TIMED = 200
"""Measurements of which the time is taken."""


@dataclass(frozen=True, eq=False)
class _Shot:
    frame: RgbdFrame
    truth: Truth
    person: Person

    @cached_property
    def whole(self) -> NDArray[np.float64]:
        """What a camera straight ahead sees of the face, also where this one does not, mm."""
        ahead = _ahead(self.person.head)
        on_head = ahead.truth.face_points() - ahead.person.shift
        return np.asarray(on_head @ self.person.rotation.T + self.person.shift)


@cache
def _ahead(head: str) -> _Shot:
    return _simulated(head)


def _simulated(head: str, *, light: Light | None = None, **person: Any) -> _Shot:
    one = Person(head, **{"distance_mm": _AT_MM} | person)
    shot, = simulate(
        Scene((one,), light=light or Light(), decor=_SEED), KINECT_CALIBRATED, _SEED)
    return _Shot(shot.frame, shot.truth, one)


def _measured(frame: RgbdFrame) -> Quality:
    """Measure a scene that stands still, as often as it takes to see the face ahead."""
    quality: Quality | None = None
    for index in range(_MEASUREMENTS):
        quality = measure(replace(frame, depth_timestamp_us=1 + 100_000 * index), quality)
        if index and quality.face and quality.face.sight == "ahead":
            break
    assert quality is not None  # noqa: S101
    return quality


def _row(value: float, shots: list[_Shot], of: Callable[[FaceQuality], float | None]) -> str:
    errors, covered, whole, gross, seen, failures = [], [], [], [], [], []
    for shot in shots:
        seen_face = _measured(shot.frame).face
        measured = None if seen_face is None else of(seen_face)
        if measured is not None:
            seen.append(measured)
        try:
            face = reconstruct(shot.frame)
        except ReconstructionError as error:
            failures.append(type(error).__name__)
            continue
        found = compare(face, shot.truth, shot.frame)
        errors.append(found.mean_mm)
        covered.append(found.covered)
        nearest, _ = cKDTree(face.dense.points).query(shot.whole, distance_upper_bound=NEAR_MM)
        whole.append(np.isfinite(nearest).mean())
        gross.append(found.gross)
    cells = [f"{value:g}", ", ".join(f"{one:.4g}" for one in seen) or "-"]
    if errors:
        cells += [f"{np.mean(errors):.2f}", f"{100 * np.mean(covered):.0f}",
                  f"{100 * np.mean(whole):.0f}", f"{100 * np.mean(gross):.1f}"]
    else:
        cells += ["-"] * 4
    return f"| {' | '.join([*cells, ', '.join(failures)])} |"


def _distance() -> Iterator[str]:
    for mm in (400, 450, 500, 600, 750, 900, 1050, 1200, 1350, 1500):
        shots = [_simulated(head, distance_mm=float(mm)) for head in _heads()]
        yield _row(mm, shots, lambda face: face.distance_mm)


def _turn() -> Iterator[str]:
    for degrees in (0, 10, 15, 20, 25, 30, 37, 45):
        shots = [_simulated(head, yaw=float(degrees)) for head in _heads()]
        yield _row(degrees, shots, lambda face: face.turn_deg)


def _tilt() -> Iterator[str]:
    for degrees in (-30, -20, -10, 0, 10, 20, 25, 30, 45):
        shots = [_simulated(head, pitch=float(degrees)) for head in _heads()]
        yield _row(degrees, shots, lambda face: face.tilt_deg)


def _center() -> Iterator[str]:
    width_mm = 640 * _AT_MM / 525
    for share in (0, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45):
        shots = [_simulated(head, offset_mm=(share * width_mm, 0.0)) for head in _heads()]
        yield _row(share, shots, lambda face: face.off_center[0])


def _coverage() -> Iterator[str]:
    for share in (0, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.5):
        yield _row(share, [_with_holes(_simulated(head), share) for head in _heads()],
                   lambda face: face.coverage)


def _motion() -> Iterator[str]:
    for mm in (0, 1, 2, 3, 4, 6, 9, 12):
        shots = [_moving(head, float(mm)) for head in _heads()]
        yield _row(mm, shots, lambda _: None)


def _blur() -> Iterator[str]:
    for sigma in (0.0, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0):
        shots, ratios = [], []
        for head in _heads():
            sharp = _simulated(head)
            image = sharp.frame.rgb if not sigma else np.asarray(
                cv2.GaussianBlur(sharp.frame.rgb, (0, 0), sigma), np.uint8)
            blurred = replace(sharp.frame, color=image, depth_timestamp_us=2_000_000)
            quality = measure(blurred, _measured(sharp.frame))
            ratios.append(quality.face.sharpness if quality.face else None)
            shots.append(replace(sharp, frame=blurred))
        known = iter(ratios)
        yield _row(sigma, shots, lambda _, known=known: next(known))  # type: ignore[misc]


def _dark() -> Iterator[str]:
    for gain in (1.0, 0.3, 0.1, 0.05, 0.03, 0.02, 0.01, 0.005):
        light = Light(intensity=0.75 * gain, ambient=0.35 * gain)
        shots = [_simulated(head, light=light) for head in _heads()]
        yield _row(gain, shots, lambda face: face.dark)


def _bright() -> Iterator[str]:
    for gain in (1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0):
        light = Light(intensity=0.75 * gain, ambient=0.35 * gain)
        shots = [_simulated(head, light=light) for head in _heads()]
        yield _row(gain, shots, lambda face: face.burnt)


def _with_holes(shot: _Shot, share: float) -> _Shot:
    """Take discs out of the depth around the face, until so much of the face is gone."""
    camera = shot.frame.depth_camera
    u, v = camera.project(shot.truth.face_points()).T
    left, right, top, bottom = u.min(), u.max(), v.min(), v.max()
    depth = shot.frame.depth.copy()
    rng = np.random.default_rng(8)
    rows, columns = np.rint(v).astype(int), np.rint(u).astype(int)
    before = (depth[rows, columns] > 0).sum()
    while (depth[rows, columns] > 0).sum() > (1 - share) * before:
        middle = round(rng.uniform(left, right)), round(rng.uniform(top, bottom))
        cv2.circle(depth, middle, round(rng.uniform(3, 12)), 0, -1)
    return replace(shot, frame=replace(shot.frame, depth=depth))


def _moving(head: str, mm_a_frame: float) -> _Shot:
    """Expose both cameras for a frame's time while the head goes to the side, colour earlier."""
    def at(share: float) -> _Shot:
        return _simulated(head, offset_mm=(share * mm_a_frame, 0.0))

    middle = at(0.0)
    if not mm_a_frame:
        return middle
    shares = np.linspace(-0.5, 0.5, _EXPOSURES)
    depths = np.stack([at(share).frame.depth for share in shares]).astype(np.float64)
    colors = np.stack([at(share - _SKEW_SHARE).frame.rgb for share in shares])
    near = np.ptp(np.where(depths > 0, depths, np.nan), axis=0) < 30
    depth = np.where((depths > 0).all(axis=0) & near, depths.mean(axis=0), 0)
    frame = replace(middle.frame, depth=np.rint(depth).astype(np.uint16),
                    color=np.rint(colors.mean(axis=0)).astype(np.uint8))
    return replace(middle, frame=frame)


def _time() -> Iterator[str]:
    """CPU time of a measurement, at ten a second as a share of one core."""
    for path in sorted(RECORDINGS.glob("*.oni")):
        with open_source(str(path)) as source:
            frames = list(source)
        quality: Quality | None = None
        begin = 0.0
        slowest = 0.0
        for index in range(-20, _TIMED):
            if index == 0:
                begin = time.process_time()
            frame = replace(frames[index % len(frames)],
                            depth_timestamp_us=1 + 100_000 * (index + 20))
            start = time.process_time()
            quality = measure(frame, quality)
            slowest = max(slowest, time.process_time() - start) if index >= 0 else 0.0
        mean_ms = 1e3 * (time.process_time() - begin) / _TIMED
        yield f"| {path.stem} | {mean_ms:.2f} | {1e3 * slowest:.1f} | {mean_ms:.1f} |"


def _heads() -> list[str]:
    return at_hand(CHOOSING)[:_HEADS]


_SECTIONS: dict[str, Callable[[], Iterator[str]]] = {
    "distance": _distance, "turn": _turn, "tilt": _tilt, "center": _center,
    "coverage": _coverage, "motion": _motion, "blur": _blur, "dark": _dark, "bright": _bright,
    "time": _time,
}
_UNITS = {
    "distance": "mm", "turn": "degrees", "tilt": "degrees", "center": "share of the width",
    "coverage": "share taken away", "motion": "mm a frame", "blur": "sigma, px",
    "dark": "light", "bright": "light",
}


def main() -> int:
    """Print a table for each section."""
    cv2.setNumThreads(1)
    for name in sys.argv[1:] or _SECTIONS:
        say = partial(print, flush=True)
        say(f"\n## {name}\n")
        if name == "time":
            say("| recording | ms of CPU, mean | most | % of a core at 10 Hz |\n|---|---|---|---|")
        else:
            say(f"| {_UNITS[name]} | measured, each head | error, mm "
                "| of what it shows, % | of the whole face, % | > 5.5 mm, % | refused |\n"
                "|---|---|---|---|---|---|---|")
        for row in _SECTIONS[name]():
            say(row)
    return 0


if __name__ == "__main__":
    sys.exit(main())
