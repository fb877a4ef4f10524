"""How many faces detection finds, under what, and how many it finds where there are none."""

import argparse
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from bench.accuracy import RECORDINGS
from bench.heads import CHOOSING, REPORTING
from bench.recall_scenes import View, empty_views, face_views, taken
from denseface.capture import RgbdFrame, open_source
from denseface.recon.detection import Detection, detect_face
from denseface.recon.errors import ReconstructionError
from denseface.recon.registration import register
from tests.simulator import Truth, shared_folder

__all__: list[str] = []

# As the pipeline does.
_SPARSE = slice(None, None, 4)
# A third of a face's width.
_NEAR_MM = 47.0
_COLUMNS = ("faces", "found", "of it near the middle", "something else", "nothing", "ms, median")


def _detected(frame: RgbdFrame) -> tuple[Detection | None, float]:
    """Detect as the pipeline does; and say how long that took, ms."""
    registered = register(frame, _SPARSE, _SPARSE)
    start = time.perf_counter()
    try:
        found = detect_face(frame.rgb, registered, frame.calibration.color.fx)
    except ReconstructionError:
        found = None
    return found, (time.perf_counter() - start) * 1e3


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


def _recall(views: list[View], folder: Path | None) -> None:
    """Print the table of faces: a row for each value of each factor."""
    rows: dict[tuple[str, str], list[str]] = defaultdict(list)
    times: dict[tuple[str, str], list[float]] = defaultdict(list)
    for view in views:
        frame, truth = taken(view, folder)
        found, ms = _detected(frame)
        verdict = "nothing"
        if found:
            middle, part = _off_mm(found, frame, truth)
            verdict = "near" if middle < _NEAR_MM else "found" if part < _NEAR_MM else "else"
        key = view.factor, view.value
        rows[key].append(verdict)
        times[key].append(ms)
        if verdict in ("else", "nothing"):
            print(f"{view.name}: {verdict}", file=sys.stderr)
    print("\n| " + " | ".join(("factor", "value", *_COLUMNS)) + " |")
    print("|" + " --- |" * (len(_COLUMNS) + 2))
    for (factor, value), verdicts in rows.items():
        near, found_, wrong, none = (
            verdicts.count(one) for one in ("near", "found", "else", "nothing"))
        print(f"| {factor} | {value} | {len(verdicts)} | {near + found_} | {near} | {wrong} "
              f"| {none} | {np.median(times[factor, value]):.1f} |")
    everything = [verdict for verdicts in rows.values() for verdict in verdicts]
    hits = sum(verdict in ("near", "found") for verdict in everything)
    print(f"\n{hits} of {len(everything)} faces found, {everything.count('else')} times something "
          "else.")


def _empty(views: list[View], folder: Path | None) -> Iterator[tuple[str, RgbdFrame]]:
    for view in views:
        yield f"simulated: {view.value}", taken(view, folder)[0]
    given = [RECORDINGS / "empty_room.oni"]
    shared = shared_folder()
    if shared:
        given += sorted((shared / "recordings").glob("*no_face*.oni"))
    for path in given:
        with open_source(str(path)) as source:
            for frame in source:
                yield f"recorded: {path.stem}", frame


def _false_faces(views: list[View], folder: Path | None) -> int:
    """Print the table of frames without a face, and give how many faces were found in them."""
    counts: dict[str, list[bool]] = defaultdict(list)
    times: dict[str, list[float]] = defaultdict(list)
    for number, (name, frame) in enumerate(_empty(views, folder)):
        found, ms = _detected(frame)
        counts[name].append(found is not None)
        times[name].append(ms)
        if found:
            what = views[number].name if number < len(views) else name
            print(f"{what}: a face at {found.box}, {found.depth_mm:.0f} mm", file=sys.stderr)
    print("\n| frames without a face | frames | false faces | ms, median | ms, longest |")
    print("|" + " --- |" * 5)
    for name, false in counts.items():
        print(f"| {name} | {len(false)} | {sum(false)} | {np.median(times[name]):.0f} "
              f"| {max(times[name]):.0f} |")
    return sum(sum(false) for false in counts.values())


def main() -> int:
    """Print both tables; fail where a face was found in a frame without one."""
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
    _recall(list(face_views(heads)), args.frames)
    return min(1, _false_faces(list(empty_views(heads, args.empty)), args.frames))


if __name__ == "__main__":
    sys.exit(main())
