"""Colours of the dense points against the true shaded ones, and the background's part in them."""

import argparse
import statistics
import sys
from collections.abc import Iterator
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from bench.cases import HOLE_SPACINGS
from bench.heads import REPORTING, at_hand
from bench.machine import describe
from denseface.recon import ReconstructionError, reconstruct
from denseface.recon.face import Face
from denseface.recon.registration import register, sample_colors
from tests.simulator import KINECT_CALIBRATED, Person, Scene, TrueColors, head_names, simulate

__all__ = ["PARTS", "Compared"]

_DISTANCES_MM = (600.0, 1100.0)
_YAW = 20.0
"""Largest turn to either side, degrees."""
_RIM_SPACINGS = 3.0
"""Points nearer to the outline are the rim, mean spacings."""
_WALLS = {"green": (30, 220, 40), "magenta": (225, 30, 200)}
_BEHIND_MM = 450.0
"""Distance of the wall behind the head, mm."""
_MOSTLY = 0.5
"""Fraction of the background in a colour from which it is the background's."""
_SHOWS = 0.25
"""Fraction from which it shows."""

Colors = NDArray[np.uint8]
PARTS = ("all", "rim", "inside holes", "eyes, brows, nostrils, mouth", "elsewhere")


@dataclass(frozen=True, eq=False)
class Compared:
    """Where the dense points of a face lie, and what colour is true there."""

    parts: dict[str, NDArray[np.bool_]]
    """Of `PARTS`: the points that the colour camera sees."""
    true: NDArray[np.float32]

    @classmethod
    def of(cls, face: Face, truth: TrueColors) -> "Compared":
        """Find each dense point's true colour, and which parts it is in."""
        dense, spacing = face.dense, face.report.mean_spacing_mm
        nearest = truth.nearest(dense.points)
        cells = tuple(dense.cells.T)
        support = np.zeros(np.add(dense.grid_shape, 2), np.uint8)
        support[1:-1, 1:-1][cells] = 1
        inward = cv2.distanceTransform(support, cv2.DIST_L2, cv2.DIST_MASK_5)[1:-1, 1:-1][cells]
        rim = inward * dense.grid_step_mm <= _RIM_SPACINGS * spacing
        away, _ = cKDTree(face.initial.points[:, :2]).query(dense.points[:, :2])
        hole = away > HOLE_SPACINGS * spacing
        seen, feature = truth.seen[nearest], truth.feature[nearest]
        parts = (seen, seen & rim, seen & hole, seen & feature,
                 seen & ~rim & ~hole & ~feature)
        return cls(dict(zip(PARTS, parts, strict=True)), truth.colors[nearest])

    def errors(self, colors: Colors) -> dict[str, float]:
        """Mean absolute difference over R, G and B, of 255, in each part; NaN in an empty one."""
        off = np.abs(colors - self.true).mean(axis=1)
        return {name: float(off[part].mean()) if part.any() else float("nan")
                for name, part in self.parts.items()}

    def background(self, colors: Colors, wall: NDArray[np.floating]) -> NDArray[np.floating]:
        """Fraction of the wall's colour, (3,), in each one, along the axis from magenta to green.

        Skin and hair lie close together on it and the walls far off: a wrong brown is no wall.
        """
        true = _greenness(self.true)
        fraction: NDArray[np.floating] = (_greenness(colors) - true) / (_greenness(wall) - true)
        return fraction


def _greenness(colors: NDArray[np.generic]) -> NDArray[np.float64]:
    red, green, blue = np.moveaxis(np.asarray(colors, np.float64), -1, 0)
    return np.asarray(green - (red + blue) / 2, np.float64)


def _scenes(count: int, heads: list[str]) -> Iterator[tuple[str, Scene]]:
    """Heads at random distances and turns, before a room; every other with large holes."""
    for index in range(count):
        rng = np.random.default_rng([17, index])
        head, distance = heads[index % len(heads)], rng.uniform(*_DISTANCES_MM)
        yaw = rng.uniform(-_YAW, _YAW)
        holes = (0.25, 1.0)[index // len(heads) % 2]
        yield (f"{head} {distance:.0f} mm {yaw:+.0f} deg",
               Scene((Person(head, distance, yaw=yaw),), holes=holes, decor=index))


def _walled(heads: list[str]) -> Iterator[tuple[str, Scene]]:
    """Each head without shoulders before a wall of a colour that no face has."""
    for index, head in enumerate(heads):
        for (name, color), (distance, yaw) in zip(
                _WALLS.items(), ((700.0, -15.0), (900.0, 12.0)), strict=True):
            person = Person(head, distance, yaw=yaw, shoulders=False)
            yield f"{head}, {name}", Scene((person,), wall_mm=distance + _BEHIND_MM,
                                           wall_color=color, decor=index)


def _faces(
    scenes: Iterator[tuple[str, Scene]], first_seed: int
) -> Iterator[tuple[str, NDArray[np.uint8], Face, Colors, Compared]]:
    """Give each scene's name, colour image, face, colours looked up, and what is true."""
    for index, (name, scene) in enumerate(scenes):
        shot, = simulate(scene, KINECT_CALIBRATED, seed=first_seed + index)
        try:
            face = reconstruct(shot.frame)
        except ReconstructionError as error:
            print(f"{name} is left out: {error}", file=sys.stderr)
            continue
        sampled, _ = sample_colors(shot.frame, register(shot.frame), face.dense.points)
        compared = Compared.of(face, TrueColors.of(scene, KINECT_CALIBRATED))
        yield name, shot.frame.rgb, face, sampled, compared


def _print_errors(count: int, heads: list[str]) -> None:
    ours: list[dict[str, float]] = []
    direct: list[dict[str, float]] = []
    for name, _, face, sampled, compared in _faces(_scenes(count, heads), 300):
        ours.append(compared.errors(face.dense.colors))
        direct.append(compared.errors(sampled))
        print(f"{name}: {ours[-1]['all']:.2f}", file=sys.stderr, flush=True)
    print(f"\n{len(ours)} frames (simulated heads {', '.join(heads)}):\n")
    print("| mean absolute difference, of 255 | " + " | ".join(PARTS) + " | worst frame |")
    print("|" + " --- |" * (len(PARTS) + 2))
    for name, found in (("ours", ours), ("each point looked up in the colour image", direct)):
        means = [statistics.fmean(v for one in found if (v := one[part]) == v) for part in PARTS]
        print(f"| {name} | " + " | ".join(f"{mean:.2f}" for mean in means)
              + f" | {max(one['all'] for one in found):.2f} |")


def _print_background(heads: list[str]) -> None:
    print("\nBefore a green or magenta wall, no shoulders; points in 10,000 (at the rim):\n")
    print("| head, wall | points | more wall than face | a quarter wall or more "
          "| each looked up: more wall | a quarter or more |")
    print("|" + " --- |" * 6)
    for name, image, face, sampled, compared in _faces(_walled(heads), 500):
        wall = np.median(image[:10].reshape(-1, 3), axis=0)
        rim = compared.parts["rim"]
        cells = []
        for colors in (face.dense.colors, sampled):
            fraction = compared.background(colors, wall)
            for least in (_MOSTLY, _SHOWS):
                over = 1e4 * (fraction > least)
                cells.append(f"{over.mean():.1f} ({over[rim].mean():.0f})")
        print(f"| {name} | {len(face.dense):,} | " + " | ".join(cells) + " |", flush=True)


def main() -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(prog="script/bench colors", description=__doc__)
    parser.add_argument("--simulated", type=int, default=24, metavar="N",
                        help="frames of heads before a room (24)")
    parser.add_argument("--heads", nargs="+", default=at_hand(REPORTING), choices=head_names(),
                        help="default: the reported ones")
    args = parser.parse_args()
    print(describe(f"script/bench colors --simulated {args.simulated}"))
    _print_errors(args.simulated, args.heads)
    _print_background(args.heads)
    return 0


if __name__ == "__main__":
    sys.exit(main())
