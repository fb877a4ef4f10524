"""How many faces detection finds, under what, and how many it finds where there are none."""

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

from bench.accuracy import RECORDINGS
from bench.heads import CHOOSING, REPORTING
from bench.own import default_haar, milliseconds
from bench.recall_scenes import (
    View,
    darkened,
    empty_views,
    face_views,
    real_without_face,
    taken,
)
from denseface.capture import RgbdFrame, open_source
from denseface.recon import reconstruct
from denseface.recon.detection import Detection, detect_by_depth, detect_face
from denseface.recon.errors import ReconstructionError
from denseface.recon.finding import find_face
from denseface.recon.judgement import score_quickly
from denseface.recon.registration import register, without_color
from tests.simulator import Truth

__all__: list[str] = []

# As the pipeline does.
_SPARSE = slice(None, None, 4)
# A third of a face's width.
_NEAR_MM = 47.0
_DARK_VIEWS = (("plain", ""), ("yaw", "+30"), ("pitch", "+20"), ("distance", "1.30 m"))
_DARK_LIGHT, _DARK_NOISE = (0.02, 0.01, 0.005, 0.002, 0.0), (2.5, 8.0)
_COLUMNS = ("faces", "found", "of it near the middle", "something else", "nothing",
            "processor's ms, median", "95th percentile")


def _detected(frame: RgbdFrame) -> tuple[Detection | None, float]:
    """Detect as the pipeline does; and say how much of the processor's time that took, ms."""
    registered = register(frame, _SPARSE, _SPARSE, colors=False)
    start = time.process_time()
    try:
        if frame.color is None:
            found = detect_by_depth(frame, registered, score=score_quickly)
        else:
            found = detect_face(frame.color, registered, frame.calibration.color.fx,
                                score=score_quickly)
    except ReconstructionError:
        found = None
    return found, (time.process_time() - start) * 1e3


def _haar_ms(frame: RgbdFrame) -> float:
    """OpenCV's default pass over a frame's picture, the processor's time."""
    gray = cv2.cvtColor(frame.rgb, cv2.COLOR_RGB2GRAY)
    return milliseconds(lambda: default_haar()(gray))


def _off_mm(found: Detection, frame: RgbdFrame, truth: Truth) -> tuple[float, float]:
    """How far the box's middle is from that of the true face; and from its nearest part, mm."""
    points = frame.depth_to_color.apply(truth.face_points())
    camera = frame.calibration.color
    pixels = camera.project(points)
    x, y, w, h = found.box
    away = (x + w / 2, y + h / 2) - pixels
    to_mm = float(np.median(points[:, 2])) / camera.fx
    middle = (x + w / 2, y + h / 2) - (pixels.min(axis=0) + pixels.max(axis=0)) / 2
    return (float(np.hypot(*middle)) * to_mm, float(np.hypot(*away.T).min()) * to_mm)


def _verdict(found: Detection | None, frame: RgbdFrame, truth: Truth) -> str:
    if found is None:
        return "nothing"
    middle, part = _off_mm(found, frame, truth)
    return "near" if middle < _NEAR_MM else "found" if part < _NEAR_MM else "else"


def _recall(views: list[View], folder: Path | None) -> None:
    """Print the tables of faces, with colour and without: a row for each value of each factor."""
    haar: list[float] = []
    tables: dict[str, dict[tuple[str, str], list[tuple[str, float]]]] = {
        "With colour": defaultdict(list), "Without, in depth alone": defaultdict(list)}
    for view in views:
        frame, truth = taken(view, folder)
        haar.append(_haar_ms(frame))
        for sight, rows in tables.items():
            seen = frame if rows is tables["With colour"] else without_color(frame)
            found, ms = _detected(seen)
            verdict = _verdict(found, seen, truth)
            rows[view.factor, view.value].append((verdict, ms))
            if verdict in ("else", "nothing"):
                print(f"{sight}: {view.name}: {verdict}", file=sys.stderr)
    for sight, rows in tables.items():
        print(f"\n{sight}:")
        _print_faces(rows, float(np.median(haar)))


def _print_faces(
    rows: dict[tuple[str, str], list[tuple[str, float]]], haar_ms: float
) -> None:
    print("\n| " + " | ".join(("factor", "value", *_COLUMNS)) + " |")
    print("|" + " --- |" * (len(_COLUMNS) + 2))
    everything = [one for row in rows.values() for one in row]
    for (factor, value), row in [*rows.items(), (("all", ""), everything)]:
        verdicts, times = zip(*row, strict=True)
        near, found, wrong, none = (
            verdicts.count(one) for one in ("near", "found", "else", "nothing"))
        print(f"| {factor} | {value} | {len(row)} | {near + found} | {near} | {wrong} | {none} "
              f"| {np.median(times):.1f} | {np.percentile(times, 95):.1f} |")
    median, high = np.percentile([ms for _, ms in everything], (50, 95)) / haar_ms
    print(f"\nOpenCV's default Haar pass: {haar_ms:.1f} ms; the median takes {median:.2f} of it, "
          f"the 95th percentile {high:.2f}.")


def _in_the_dark(views: list[View], folder: Path | None) -> None:
    """Print what finds the faces in little light."""
    views = [view for view in views if (view.factor, view.value) in _DARK_VIEWS]
    print("\n| light | noise, grey levels | faces | found in colour | in depth, grey | not |")
    print("|" + " --- |" * 6)
    for noise in _DARK_NOISE:
        for light in _DARK_LIGHT:
            found = [_found(darkened(taken(view, folder)[0], light, noise, view.seed))
                     for view in views]
            print(f"| {light:g} | {noise:g} | {len(views)} | {found.count('colour')} "
                  f"| {found.count('depth')} | {found.count('neither')} |")


def _found(frame: RgbdFrame) -> str:
    try:
        return "colour" if find_face(frame, lambda _: None).colored else "depth"
    except ReconstructionError:
        return "neither"


def _empty(views: list[View], folder: Path | None) -> Iterator[tuple[str, RgbdFrame]]:
    for view in views:
        yield f"simulated: {view.value}", taken(view, folder)[0]
    for path in [RECORDINGS / "empty_room.oni", *real_without_face()]:
        kind = "tables" if path.suffix == ".npz" else path.stem
        with open_source(str(path)) as source:
            for frame in source:
                yield f"recorded: {kind}", frame


def _false_faces(views: list[View], folder: Path | None) -> int:
    """Print the tables of frames without a face, and give how many faces were found in them."""
    tables: dict[str, dict[str, list[tuple[bool, bool, float]]]] = {
        "With colour": defaultdict(list), "Without, in depth alone": defaultdict(list)}
    haar: list[float] = []
    for number, (name, frame) in enumerate(_empty(views, folder)):
        haar.append(_haar_ms(frame))
        for sight, rows in tables.items():
            seen = frame if rows is tables["With colour"] else without_color(frame)
            found, ms = _detected(seen)
            rows[name].append((found is not None, found is not None and _is_face(seen), ms))
            if found:
                what = views[number].name if number < len(views) else name
                print(f"{sight}: {what}: a face at {found.box}, {found.depth_mm:.0f} mm",
                      file=sys.stderr)
    for sight, rows in tables.items():
        print(f"\n{sight}; OpenCV's default Haar pass takes {np.median(haar):.1f} ms:")
        print("\n| frames without a face | frames | false boxes | false faces "
              "| processor's ms, median | 95th percentile |")
        print("|" + " --- |" * 6)
        for name, row in rows.items():
            boxes, faces, times = zip(*row, strict=True)
            print(f"| {name} | {len(row)} | {sum(boxes)} | {sum(faces)} "
                  f"| {np.median(times):.0f} | {np.percentile(times, 95):.0f} |")
    return sum(face for rows in tables.values() for row in rows.values() for _, face, _ in row)


def _is_face(frame: RgbdFrame) -> bool:
    """Say whether a face leaves the last judgement, too."""
    try:
        reconstruct(frame)
    except ReconstructionError:
        return False
    return True


def main() -> int:
    """Print the tables; fail where a face was found in a frame without one."""
    parser = argparse.ArgumentParser(prog="python -m bench.recall", description=__doc__)
    parser.add_argument("--heads", choices=("reporting", "choosing"), default="reporting",
                        help="those of the tables, or those that settings are chosen on")
    parser.add_argument("--empty", type=int, default=500, metavar="COUNT",
                        help="simulated frames without a face, half of them mirror images of the "
                             "other half (default: 500)")
    parser.add_argument("--frames", type=Path, metavar="FOLDER",
                        help="keep the simulated frames there, and take them from there next time")
    args = parser.parse_args()
    if args.frames:
        args.frames.mkdir(parents=True, exist_ok=True)
    heads = REPORTING if args.heads == "reporting" else CHOOSING
    faces = list(face_views(heads))
    _recall(faces, args.frames)
    _in_the_dark(faces, args.frames)
    return min(1, _false_faces(list(empty_views(heads, args.empty)), args.frames))


if __name__ == "__main__":
    sys.exit(main())
