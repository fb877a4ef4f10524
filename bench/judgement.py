"""Fit what a result's score weighs, and say how well it tells faces from things.

Things are shaped in a box as given: cascades take few of them for a face, the judgement shall see
them all.
"""

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterable, Iterator
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from bench.composites import composites
from bench.hard_faces import hard_views, sensor_views, turned_views
from bench.heads import CHOOSING, REPORTING
from bench.recall_scenes import face_views, taken
from denseface.capture import RgbdFrame
from denseface.capture.npz import load_frame, save_frame
from denseface.recon.detection import detect_face
from denseface.recon.errors import ReconstructionError
from denseface.recon.face import Box
from denseface.recon.fitting import plan_fit, surface_of
from denseface.recon.judgement import LEAST_SCORE, check_face
from denseface.recon.judgement._judge import score_of, surface_points
from denseface.recon.judgement._likeness import Likeness, likenesses
from denseface.recon.noise import measure_noise
from denseface.recon.registration import register, sample_colors
from denseface.recon.segmentation import box_window, segment_face
from denseface.recon.settings import Settings
from denseface.recon.surface import MIN_SEEDS, mean_spacing
from denseface.recon.warmup import warm
from tests.simulator import Truth

__all__: list[str] = []

Doubles = NDArray[np.float64]

_SPARSE = slice(None, None, 4)
_ASIDE_MM = 70.0
"""A box whose middle lies farther beside a face's is not that face's."""
_RIDGE = 0.01
_SHARE = 0.6
"""What all faces weigh together, of 1: of things, detection has passed nearly all before."""
_ROUNDS = 4
"""Of the fit: a face is what its best placement says, a thing must be none by all of its."""


def points_in(frame: RgbdFrame, box: Box) -> Doubles | None:
    """Shape what a box shows, as the pipeline does, and give the points that are judged."""
    settings, focal_px = Settings(), frame.calibration.color.fx
    overview = register(frame, _SPARSE, _SPARSE, colors=False)
    try:
        registered = register(frame, *box_window(overview, box))
        seeds = segment_face(registered, box, focal_px)
        if len(seeds.points) < MIN_SEEDS:
            return None
        check_face(seeds.points, 1 / (frame.depth_camera.fx * frame.depth_camera.fy), box)
        spacing = mean_spacing(seeds.points, seeds.pixels, settings.neighbors)
        noise = measure_noise(seeds.points, seeds.pixels, spacing)
        surface = surface_of(seeds.points, spacing, settings, plan_fit(settings, noise, spacing),
                             partial(sample_colors, frame, registered))
    except ReconstructionError:
        return None
    return surface_points(surface)


def _faces(heads: tuple[str, ...], hard: int, folder: Path) -> Iterator[tuple[str, Doubles]]:
    """Give the faces that detection finds, by what is out of the ordinary."""
    for view in [*face_views(heads), *hard_views(heads, hard), *turned_views(heads),
                 *sensor_views(heads)]:
        frame, truth = taken(view, folder)
        overview = register(frame, _SPARSE, _SPARSE, colors=False)
        try:
            box = detect_face(frame.rgb, overview, frame.calibration.color.fx).box
        except ReconstructionError as error:
            print(f"{view.name}: {error}", file=sys.stderr)
            continue
        points = points_in(frame, box) if _is_on_face(box, frame, truth) else None
        if points is None:
            print(f"{view.name}: the box at {box} is another thing's", file=sys.stderr)
        else:
            yield view.factor, points


def _is_on_face(box: Box, frame: RgbdFrame, truth: Truth) -> bool:
    """Say whether a box's middle is a face's, nearly."""
    points = truth.face_points()
    pixels = frame.calibration.color.project(frame.depth_to_color.apply(points))
    middle = box[0] + box[2] / 2, box[1] + box[3] / 2
    off_px = float(np.hypot(*(np.median(pixels, axis=0) - middle)))
    return off_px * float(np.median(points[:, 2])) < _ASIDE_MM * frame.calibration.color.fx


def _things(count: int, first: int, folder: Path) -> Iterator[tuple[str, Doubles]]:
    """Give what composites show in their boxes, and has a face's size."""
    for number in range(first, first + count):
        kept = folder / f"thing_{number}.npz"
        if not kept.exists():
            composite, = composites(1, number)
            save_frame(composite.frame, kept)
            kept.with_suffix(".txt").write_text(
                " ".join(map(str, composite.box)) + f" {composite.thing.kind}")
        x, y, w, h, kind = kept.with_suffix(".txt").read_text().split(maxsplit=4)
        points = points_in(load_frame(kept), (int(x), int(y), int(w), int(h)))
        if points is not None:
            yield kind, points


def _fit(faces: list[list[Likeness]], things: list[list[Likeness]]) -> Doubles:
    """Give the weights and, last, the bias."""
    positive = [np.array([one.figures for one in placements]) for placements in faces]
    negative = np.array([one.figures for placements in things for one in placements])
    best = np.array([figures[figures[:, 0].argmax()] for figures in positive])
    weights = np.zeros(best.shape[1] + 1)
    for _ in range(_ROUNDS):
        weights = _regression(best, negative)
        best = np.array([figures[(figures @ weights[:-1]).argmax()] for figures in positive])
    return weights


def _regression(positive: Doubles, negative: Doubles) -> Doubles:
    """Fit a logistic regression with a ridge on scaled figures."""
    figures = np.concatenate([positive, negative])
    sides = np.concatenate([np.ones(len(positive)), -np.ones(len(negative))])
    share = np.where(sides > 0, _SHARE / len(positive), (1 - _SHARE) / len(negative))
    mean, spread = figures.mean(axis=0), figures.std(axis=0) + 1e-9
    scaled = (figures - mean) / spread

    def loss(given: Doubles) -> tuple[float, Doubles]:
        margins = sides * (scaled @ given[:-1] + given[-1])
        slope = -share * sides / (1 + np.exp(np.clip(margins, -50, 50)))
        ridge = _RIDGE * given[:-1]
        return (float(share @ np.logaddexp(0, -margins) + ridge @ given[:-1] / 2),
                np.append(scaled.T @ slope + ridge, slope.sum()))

    found = minimize(loss, np.zeros(figures.shape[1] + 1), jac=True).x
    weights = found[:-1] / spread
    return np.append(weights, found[-1] - mean @ weights)


def _table(name: str, given: Iterable[tuple[str, list[Likeness]]]) -> None:
    """Print how many of each kind have a face's score."""
    scores: dict[str, list[float]] = defaultdict(list)
    for kind, placements in given:
        scores[kind].append(max(map(score_of, placements)))
    print(f"\n| {name} | boxes | taken for a face | least | median | highest score |")
    print("|" + " --- |" * 6)
    scores["all"] = [score for kind in scores.values() for score in kind]
    for kind, found in scores.items():
        print(f"| {kind} | {len(found)} | {sum(one >= LEAST_SCORE for one in found)} "
              f"| {min(found):.2f} | {np.median(found):.2f} | {max(found):.2f} |")


def main() -> int:
    """Print the weights that were fitted, then the tables by those in the code.

    With the defaults they are the same.
    """
    parser = argparse.ArgumentParser(prog="python -m bench.judgement", description=__doc__)
    parser.add_argument("--things", type=int, default=120, metavar="COUNT",
                        help="composites to fit to, and as many others to report (default: 120)")
    parser.add_argument("--hard", type=int, default=30, metavar="COUNT",
                        help="faces of other proportions in hard scenes, beside the others, "
                             "to fit to, and others to report (default: 30)")
    parser.add_argument("--kept", type=Path, required=True, metavar="FOLDER",
                        help="frames are kept there, and taken from there next time")
    args = parser.parse_args()
    args.kept.mkdir(parents=True, exist_ok=True)
    warm()
    sets = []
    for heads, first in ((CHOOSING, 0), (REPORTING, args.things)):
        faces = [(kind, list(likenesses(points)))
                 for kind, points in _faces(heads, args.hard, args.kept)]
        things = [(kind, list(likenesses(points)))
                  for kind, points in _things(args.things, first, args.kept)]
        sets.append((faces, things))
    faces, things = sets[0]
    fitted = _fit([one for _, one in faces], [one for _, one in things])
    print("weights", np.round(fitted[:-1], 2).tolist(), "bias", round(float(fitted[-1]), 2))
    for name, (faces, things) in zip(("fitted", "reported"), sets, strict=True):
        _table(f"faces, {name}", faces)
        _table(f"things, {name}", things)
    return 0


if __name__ == "__main__":
    sys.exit(main())
