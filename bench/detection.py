"""What detection costs, by kind of scene, against OpenCV's default Haar pass on the same image."""

import argparse
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import cv2
import numpy as np

from bench.detection_scenes import Seen, seen_frames
from bench.heads import CHOOSING, REPORTING
from bench.machine import describe
from bench.own import default_haar, milliseconds
from denseface.capture import RgbdFrame
from denseface.recon import warm
from denseface.recon.detection import _detect as stage
from denseface.recon.detection import _passes as passes
from denseface.recon.errors import ReconstructionError
from denseface.recon.finding import find_face

__all__: list[str] = []

_RUNS = 3
_PERCENTILES = (50, 95)
_GOAL = 0.15


@contextmanager
def _passes_counted() -> Iterator[Counter[str]]:
    """Count which passes run, the box's refinement left out."""
    counts: Counter[str] = Counter()
    names = {passes.STRAIGHT: "straight", passes.FINE: "fine",
             **dict.fromkeys(passes.TIPPED, "tipped"), passes.PROFILES[0]: "profiles",
             **dict.fromkeys([rung[0] for rung in passes.LIFTED_RUNGS], "shadows lifted")}
    search = stage.Search.nearest_face

    def counting(self: stage.Search, rung: Any, regions: Any, picture: Any) -> Any:
        equalised = picture == self.equalized
        counts[names.get(rung[0], "turned images") + ", equalised" * equalised] += bool(regions)
        return search(self, rung, regions, picture)

    with patch.object(stage.Search, "nearest_face", counting):
        yield counts


def _measured(seen: Seen) -> tuple[float, float, bool]:
    """Give the least processor's time of detection and of the peer, by turns, ms; and if found."""
    gray = cv2.cvtColor(seen.frame.rgb, cv2.COLOR_RGB2GRAY)
    ours, peers, found = [], [], False
    for _ in range(_RUNS):
        ms, found = _detected(seen.frame)
        ours.append(ms)
        peers.append(milliseconds(lambda: default_haar()(gray)))
    return min(ours), min(peers), found


def _detected(frame: RgbdFrame) -> tuple[float, bool]:
    """Detect as the pipeline does, hint at turned images included; the time without overview."""
    start = time.process_time()

    def lap(name: str) -> None:
        nonlocal start
        if name == "overview":
            start = time.process_time()

    try:
        find_face(frame, lap)
    except ReconstructionError:
        found = False
    else:
        found = True
    return (time.process_time() - start) * 1e3, found


def main() -> int:
    """Print the table; fail where a face was found in a frame without one."""
    parser = argparse.ArgumentParser(prog="script/bench detection", description=__doc__)
    parser.add_argument("--heads", choices=("reporting", "choosing"), default="reporting",
                        help="those of the tables, or those that settings are chosen on")
    parser.add_argument("--count", type=int, default=8, metavar="N",
                        help="frames of each simulated kind of face (8)")
    parser.add_argument("--frames", type=Path, metavar="FOLDER",
                        help="keep the simulated frames there, and take them from there next time")
    args = parser.parse_args()
    if args.frames:
        args.frames.mkdir(parents=True, exist_ok=True)
    cv2.setNumThreads(1)
    print(describe("script/bench detection " + " ".join(sys.argv[1:])))
    warm()
    rows: dict[str, list[tuple[float, float, bool]]] = defaultdict(list)
    ran: dict[str, Counter[str]] = defaultdict(Counter)
    false = 0
    for seen in seen_frames(REPORTING if args.heads == "reporting" else CHOOSING,
                            args.count, args.frames):
        with _passes_counted() as counts:
            taken = _measured(seen)
        rows[seen.kind].append(taken)
        ran[seen.kind] += counts
        false += taken[2] and not seen.face
    print("\n| kind | frames | faces found | detection, ms: median, p95 | Haar, ms: median | "
          "ratio: median | ratio: p95 | passes a frame |\n" + "|" + " --- |" * 8)
    for kind, measured in rows.items():
        print(_row(kind, measured) + f" {_listed(ran[kind], len(measured) * _RUNS)} |")
    everything = [one for measured in rows.values() for one in measured]
    print(_row("all", everything) + " |")
    print(f"\nGoal: p95 of the ratio over all frames at most {_GOAL}. {false} false faces.")
    return min(1, false)


def _row(kind: str, measured: list[tuple[float, float, bool]]) -> str:
    ours, peers, found = (np.array(column) for column in zip(*measured, strict=True))
    median, most = np.percentile(ours, _PERCENTILES)
    ratio, most_ratio = np.percentile(ours / peers, _PERCENTILES)
    return (f"| {kind} | {len(measured)} | {found.sum()} | {median:.1f}, {most:.1f} "
            f"| {np.median(peers):.0f} | {ratio:.2f} | {most_ratio:.2f} |")


def _listed(counts: Counter[str], frames: int) -> str:
    return ", ".join(f"{name} {count / frames:.1f}" for name, count in counts.items() if count)


if __name__ == "__main__":
    sys.exit(main())
