"""Contact sheet: colour, depth and labels of one head, or of all, seen straight and turned."""

import argparse

import cv2
import numpy as np
from numpy.typing import NDArray

from tests.simulator import Person, Scene, Simulated, head_names, simulate

_TINTS = np.array([(0, 0, 0), (80, 200, 80), (200, 160, 60), (80, 90, 200), (60, 60, 60),
                   (180, 60, 180), (220, 220, 60), (60, 220, 220)], np.uint8)


def sheet(shown: Simulated) -> NDArray[np.uint8]:
    """Draw colour, depth and true labels side by side, (480, 1920, 3) uint8 RGB."""
    depth = shown.frame.depth
    near = np.clip(255 - (depth.astype(float) - 450) / 2.5, 20, 255) * (depth > 0)
    truth, labels = shown.truth, np.zeros((960, 1280), np.uint8)
    labels[truth.top:truth.top + truth.labels.shape[0],
           truth.left:truth.left + truth.labels.shape[1]] = truth.labels
    return np.hstack([shown.frame.rgb, np.repeat(near[..., None], 3, axis=2).astype(np.uint8),
                      _TINTS[labels[::2, ::2]]])


def main() -> None:
    """Write the sheet."""
    parser = argparse.ArgumentParser(prog="python -m tests.simulator", description=__doc__)
    parser.add_argument("head", choices=["all", *head_names()])
    parser.add_argument("out")
    parser.add_argument("--distance", type=float, default=700)
    given = parser.parse_args()
    names = head_names() if given.head == "all" else [given.head]
    rows = [np.vstack([sheet(simulate(Scene(people=(
        Person(head=name, distance_mm=given.distance, yaw=yaw),)))[0]) for yaw in (0, 20)])
        for name in names]
    cv2.imwrite(given.out, cv2.cvtColor(np.vstack(rows), cv2.COLOR_RGB2BGR))


if __name__ == "__main__":
    main()
