"""Things that are no faces, put into frames of real tables, and before people: none is to leave.

Of the real frames without a face that are at hand, none is to, either.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.heads import CHOOSING, REPORTING, at_hand
from bench.objects import KINDS, Seen, Thing, make_thing, seen_by
from bench.recall_scenes import real_without_face
from denseface.capture import RgbdFrame, open_source
from denseface.capture.npz import load_frame
from denseface.recon import reconstruct
from denseface.recon.detection import REJECTED, detect_face
from denseface.recon.errors import ReconstructionError
from denseface.recon.face import Box
from denseface.recon.registration import register
from tests.simulator import KINECT_CALIBRATED, Person, Scene, shared_folder, simulate
from tests.simulator.depth_noise import KINECT_V1
from tests.simulator.shift import depth_to_shift, quantize

__all__ = ["Composite", "before_people", "composites"]

Bytes = NDArray[np.uint8]
Doubles = NDArray[np.float64]

_CORRELATION_PX = 1.4
"""Of the noise on a thing, as of the sensor's own."""
_GRAZING = 0.15
"""A surface whose normal makes a smaller cosine with the ray gives no reading."""
_BOXES_MM = (120.0, 200.0)
"""Widths of the boxes in which things are taken for faces."""
_NEAREST_MM, _FARTHEST_MM = 550.0, 1400.0
"""Where things stand."""
_BEHIND_MM = 100.0
"""So near to a person's distance is that person's face."""


@dataclass(frozen=True, eq=False)
class Composite:
    """A frame with a thing in it.

    Attributes
    ----------
    frame : the frame
    thing : what stands in it
    box : around the thing's middle, as a cascade might draw it; pixels of the colour image
    """

    frame: RgbdFrame
    thing: Thing
    box: Box


def composites(count: int, first: int = 0, kinds: tuple[str, ...] = KINDS) -> Iterator[Composite]:
    """Make composites; the same number gives the same one."""
    rooms = _rooms()
    for number in range(first, first + count):
        rng = np.random.default_rng([14, number])
        room = rooms[rng.integers(len(rooms))]
        yield _composite(room, kinds[number % len(kinds)], rng, _place(room, rng))


def before_people(count: int) -> Iterator[tuple[Composite, float]]:
    """Make composites with a thing beside and before a person, and say how far that is, mm."""
    people = _people()
    for number in range(count):
        rng = np.random.default_rng([16, number])
        (room, distance), side = people[number % len(people)], 1 - 2 * (number % 2)
        z = float(rng.uniform(_NEAREST_MM, 0.75 * distance))
        place = np.array([-side * rng.uniform(0.14, 0.22) * z, rng.uniform(-0.1, 0.1) * z, z])
        yield _composite(room, ("printed tin", "tin")[number % 3 // 2], rng, place), distance


@cache
def _people() -> list[tuple[RgbdFrame, float]]:
    """Simulate a person now on one side, now on the other."""
    taken = []
    for number, head in enumerate([*at_hand(REPORTING), *at_hand(REPORTING)]):
        distance = 950.0 + 60 * number
        aside = (1 - 2 * (number % 2)) * 0.16 * distance
        scene = Scene((Person(head, distance, offset_mm=(aside, 0.0)),), decor=number)
        taken.append((simulate(scene, KINECT_CALIBRATED, seed=number)[0].frame, distance))
    return taken


@cache
def _rooms() -> list[RgbdFrame]:
    """Give the frames of real tables; without those, rooms of the simulator."""
    shared = shared_folder()
    if shared:
        return [load_frame(path) for path in sorted((shared / "reports").glob("table_*.npz"))]
    return [simulate(Scene((), decor=seed), KINECT_CALIBRATED, seed=seed)[0].frame
            for seed in range(3)]


@cache
def _printed_faces() -> list[Bytes]:
    """Render the pictures that are printed on cards and tins."""
    pictures = []
    for head in at_hand(CHOOSING):
        shot, = simulate(Scene((Person(head, 600.0),), wall_mm=1000.0), KINECT_CALIBRATED)
        points = shot.frame.depth_to_color.apply(shot.truth.face_points())
        pixels = shot.frame.calibration.color.project(points)
        (left, top), (right, bottom) = pixels.min(axis=0), pixels.max(axis=0)
        wide, high = 0.25 * (right - left), 0.2 * (bottom - top)
        part = shot.frame.rgb[round(top - high):round(bottom + high),
                              round(left - wide):round(right + wide)]
        pictures.append(np.asarray(part, np.uint8, order="C"))
    return pictures


def _composite(room: RgbdFrame, kind: str, rng: np.random.Generator, place: Doubles) -> Composite:
    depth_camera, color_camera = room.depth_camera, room.calibration.color
    thing = make_thing(kind, rng, [one.rgb for one in _rooms()], _printed_faces(), place)
    still = np.eye(3), np.zeros(3)
    seen = seen_by(depth_camera, thing, still)
    in_color = seen
    if not room.registered:
        way = room.calibration.depth_to_color
        in_color = seen_by(color_camera, thing, (np.array(way.rotation),
                                                 np.array(way.translation_mm)))
    depth = _with_depth(room.depth, seen, rng)
    color = _with_color(room.rgb, in_color, rng)
    middle = room.depth_to_color.apply(place[None].astype(np.float32))
    u, v = color_camera.project(middle)[0]
    width = rng.uniform(*_BOXES_MM) * color_camera.fx / (place[2] - 0.4 * thing.radius_mm)
    u, v = u + 0.15 * width * rng.uniform(-1, 1), v + 0.25 * width * rng.uniform(-1, 1)
    box = round(u - width / 2), round(v - width / 2), round(width), round(width)
    return Composite(replace(room, depth=depth, color=color), thing, box)


def _place(room: RgbdFrame, rng: np.random.Generator) -> Doubles:
    """Choose where a thing stands: before what was measured there."""
    across, down = rng.uniform((-0.3, -0.2), (0.3, 0.2))
    (u, v), = room.depth_camera.project(np.array([[across, down, 1.0]]))
    around = room.depth[round(v) - 20:round(v) + 20, round(u) - 20:round(u) + 20]
    behind = float(np.median(around[around > 0])) if around.any() else _FARTHEST_MM
    z = rng.uniform(_NEAREST_MM, max(min(behind, _FARTHEST_MM), _NEAREST_MM + 1))
    return np.array([across, down, 1.0]) * z


def _with_depth(depth: NDArray[np.uint16], seen: Seen, rng: np.random.Generator
                ) -> NDArray[np.uint16]:
    """Put a thing before what was measured, with a structured-light sensor's noise and levels."""
    white = rng.standard_normal(depth.shape, dtype=np.float32)
    smooth = cv2.GaussianBlur(white, (0, 0), _CORRELATION_PX)
    noise = smooth / smooth.std() * KINECT_V1.axial_mm(seen.depth) * rng.uniform(0.5, 1.2)
    there = (seen.depth > 0) & ((depth == 0) | (seen.depth < depth))
    levels = quantize(depth_to_shift(np.maximum(seen.depth + noise, 1)))
    return np.where(there, np.where(seen.facing > _GRAZING, levels, 0), depth).astype(np.uint16)


def _with_color(color: Bytes, seen: Seen, rng: np.random.Generator) -> Bytes:
    """Put a thing into the colour image, with its edge smoothed and noise."""
    part = cv2.GaussianBlur((seen.depth > 0).astype(np.float32), (0, 0), 0.7)[..., None]
    noisy = seen.color + 2.5 * rng.standard_normal(color.shape, dtype=np.float32)
    return np.clip(np.rint(part * noisy + (1 - part) * color), 0, 255).astype(np.uint8)


def _outcome(frame: RgbdFrame) -> tuple[str, str, float]:
    """Reconstruct: `face`, `none by its shape` or `nothing`; what was said; the face's depth."""
    sparse = slice(None, None, 4)
    try:
        # As the pipeline does; but without its look at the images turned.
        detect_face(frame.rgb, register(frame, sparse, sparse, colors=False),
                    frame.calibration.color.fx)
        face = reconstruct(frame)
    except ReconstructionError as error:
        judged = any(one.verdict == REJECTED for one in error.candidates)
        return "none by its shape" if judged else "nothing", str(error), 0.0
    return ("face", f"{face.report.face_box}, score {face.report.face_score:.2f}",
            float(np.median(face.dense.points[:, 2])))


def _kept_outcomes(count: int, first: int, kept: Path | None) -> Iterator[tuple[str, str]]:
    """Give kind and outcome of each composite; lines of a file are those that are known."""
    known = {}
    if kept and kept.exists():
        known = dict(line.split(maxsplit=1) for line in kept.read_text().splitlines())
    for number in range(first, first + count):
        if str(number) not in known:
            composite, = composites(1, number)
            outcome, said, _ = _outcome(composite.frame)
            known[str(number)] = f"{composite.thing.kind}: {outcome}"
            if outcome == "face":
                print(f"composite {number}, {composite.thing.kind}: {said}", file=sys.stderr)
            if kept:
                with kept.open("a") as file:
                    file.write(f"{number} {known[str(number)]}\n")
        kind, outcome = known[str(number)].split(": ")
        yield kind, outcome


def _real_frames() -> Iterator[tuple[str, RgbdFrame]]:
    """Give the real frames at hand that show no face."""
    for path in real_without_face():
        if path.suffix == ".npz":
            yield "tables" if path.stem.startswith("table") else path.stem, load_frame(path)
            continue
        with open_source(str(path)) as source:
            for frame in source:
                yield path.stem, frame


def main() -> int:
    """Print the tables; fail where something left as a face that is none."""
    parser = argparse.ArgumentParser(prog="python -m bench.composites", description=__doc__)
    parser.add_argument("--count", type=int, default=300, help="composites (default: 300)")
    parser.add_argument("--first", type=int, default=0, metavar="NUMBER",
                        help="number of the first (default: 0)")
    parser.add_argument("--people", type=int, default=32, metavar="COUNT",
                        help="composites with a person behind (default: 32)")
    parser.add_argument("--kept", type=Path, metavar="FILE",
                        help="outcomes are kept there, and taken from there next time")
    args = parser.parse_args()
    rows: dict[str, list[str]] = defaultdict(list)
    for kind, outcome in _kept_outcomes(args.count, args.first, args.kept):
        rows[kind].append(outcome)
    for name, frame in _real_frames():
        rows[f"real: {name}"].append(_outcome(frame)[0])
    print("| what is shown | frames | taken for a face by detection | left as a face |")
    print("| --- | --- | --- | --- |")
    for kind, outcomes in rows.items():
        print(f"| {kind} | {len(outcomes)} | {len(outcomes) - outcomes.count('nothing')} "
              f"| {outcomes.count('face')} |")
    false = sum(outcomes.count("face") for outcomes in rows.values())
    print(f"\n{false} of {sum(map(len, rows.values()))} left as a face that is none.")
    right = sum(abs(_outcome(composite.frame)[2] - distance) < _BEHIND_MM
                for composite, distance in before_people(args.people))
    print(f"The person behind was taken in {right} of {args.people} composites.")
    return min(1, false)


if __name__ == "__main__":
    sys.exit(main())
