"""Stage 2: the face in the colour image, by Haar cascades, confirmed by its depth."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import FaceWithoutDepthError, NoDepthError, NoFaceError
from recon.face import Box, FaceCandidate
from recon.registration import Registration

__all__ = ["FACE_WIDTH_MM", "Detection", "detect_face", "find_boxes"]

FACE_WIDTH_MM = (110.0, 210.0)
"""How wide a cascade's box around a face is, child to large adult, hair included."""

# Viola and Jones, 2001, doi:10.1109/CVPR.2001.990517.
_ALT2 = "haarcascade_frontalface_alt2"
_DEFAULT = "haarcascade_frontalface_default"
_ALT = "haarcascade_frontalface_alt"


class _Rung(NamedTuple):
    """One way to look for faces."""

    shrink: int
    """The image is searched at one part in so many of its width."""
    cascade: str
    scale_step: float = 1.1
    min_neighbors: int = 5


# The first rung on which depth confirms a face ends the search: most faces are found on the first,
# the others see those that it misses (far, turned, lit from the side).
_LADDER = (_Rung(3, _ALT2, 1.2, 3), _Rung(2, _ALT2), _Rung(1, _ALT2), _Rung(1, _DEFAULT),
           _Rung(1, _ALT))
# The box found small is sought again at full size, around itself and of about its own size.
_REFINED = _Rung(1, _ALT2, 1.05, 3)
_REFINE_AROUND = 0.3
_REFINE_SIZES = (0.75, 1.25)
# The cascades were trained on 20-24 pixel faces and gain nothing beyond this width of the image.
_WIDEST = 640
# A face farther away has too few depth pixels to be worth a search.
_FARTHEST_MM = 3000.0
_NEAREST_MM = 300.0
# The middle of a box, where a face has depth: half of it each way.
_MIDDLE = 0.5
_LEAST_MIDDLE_SHARE = 0.1


@dataclass(frozen=True)
class Detection:
    """The chosen box with its depth, and all boxes that were weighed.

    Attributes
    ----------
    box : x, y, width, height; pixels of the colour image
    depth_mm : median z, in the colour camera's frame, in the middle of the box
    candidates : every box, the chosen one first, then by depth
    """

    box: Box
    depth_mm: float
    candidates: tuple[FaceCandidate, ...]


def detect_face(
    color: NDArray[np.uint8], registered: Registration, focal_px: float
) -> Detection:
    """Find the nearest face whose size fits its depth.

    Parameters
    ----------
    color : (H', W', 3) uint8, RGB
    registered : the depth tied to that image
    focal_px : focal length of the colour camera, pixels

    Raises
    ------
    NoFaceError
        Where no box was found, or none is a face's size at its depth.
    FaceWithoutDepthError
        Where faces were seen but nothing was measured on them.
    NoDepthError
        Where nothing measured lies before the colour camera.
    """
    smallest, largest = _box_sizes(registered, focal_px)
    seen: list[FaceCandidate] = []
    for gray in _grays(color):
        to_color = color.shape[1] / gray.shape[1]
        for rung in _LADDER:
            boxes = _search(gray, rung, smallest / to_color, largest / to_color)
            weighed = [_weigh(_scaled(box, to_color), registered, focal_px) for box in boxes]
            seen += weighed
            faces = [c for c in weighed if c.verdict == "face"]
            if faces:
                chosen = _choose(faces, seen)
                if rung.shrink == 1:
                    return chosen
                refined = _weigh(
                    _scaled(_refine(gray, _scaled(chosen.box, 1 / to_color)), to_color),
                    registered, focal_px)
                if refined.verdict != "face" or refined.depth_mm is None:
                    return chosen
                return Detection(refined.box, refined.depth_mm, (
                    refined.model_copy(update={"verdict": "chosen"}), *chosen.candidates[1:]))
    if not seen:
        raise NoFaceError("no face found in the colour image")
    if all(c.depth_mm is None for c in seen):
        raise FaceWithoutDepthError(
            f"face seen at {seen[0].box}, but no depth was measured on it")
    measured = next(c for c in seen if c.depth_mm is not None)
    raise NoFaceError(
        f"no face found: the box at {measured.box} is {measured.width_mm:.0f} mm wide at its "
        f"depth, a face is {FACE_WIDTH_MM[0]:.0f}-{FACE_WIDTH_MM[1]:.0f} mm")


def find_boxes(
    gray: NDArray[np.uint8],
    cascade: str,
    smallest: float,
    largest: float,
    scale_step: float = 1.1,
    min_neighbors: int = 5,
) -> list[Box]:
    """Run one cascade over a (H, W) uint8 image for boxes between two widths, pixels."""
    widest = max(gray.shape)  # and beyond it may be more than OpenCV's integers hold
    low, high = int(min(smallest, widest)), int(np.ceil(min(largest, widest)))
    found = _cascade(cascade).detectMultiScale(
        gray, scaleFactor=scale_step, minNeighbors=min_neighbors,
        minSize=(low, low), maxSize=(high, high))
    return [(int(x), int(y), int(w), int(h)) for x, y, w, h in found]


def _search(gray: NDArray[np.uint8], rung: _Rung, smallest: float, largest: float) -> list[Box]:
    k = rung.shrink
    if k > 1:
        gray = np.asarray(cv2.resize(gray, None, fx=1 / k, fy=1 / k, interpolation=cv2.INTER_AREA),
                          np.uint8)
    found = find_boxes(gray, rung.cascade, smallest / k, largest / k, rung.scale_step,
                       rung.min_neighbors)
    return [_scaled(box, k) for box in found]


def _refine(gray: NDArray[np.uint8], box: Box) -> Box:
    """Find a box again with less rounding; the same one where it is not found again."""
    x, y, w, h = box
    around = round(_REFINE_AROUND * w)
    left, top = max(x - around, 0), max(y - around, 0)
    near = np.ascontiguousarray(gray[top:y + h + around, left:x + w + around])
    found = _search(near, _REFINED, _REFINE_SIZES[0] * w, _REFINE_SIZES[1] * w)
    if not found:
        return box
    x, y, w, h = max(found, key=lambda b: b[2])
    return x + left, y + top, w, h


@cache
def _cascade(name: str) -> cv2.CascadeClassifier:
    path = Path(cv2.__file__).parent / "data" / f"{name}.xml"
    classifier = cv2.CascadeClassifier(str(path))
    if classifier.empty():
        raise RuntimeError(f"{path}: OpenCV ships no such cascade (version 5 has none)")
    return classifier


def _grays(color: NDArray[np.uint8]) -> Iterator[NDArray[np.uint8]]:
    """The image as it is, then with its contrast evened out for faces in the dark or lit aslant."""
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    scale = _WIDEST / color.shape[1]
    if scale < 1:
        gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    yield np.asarray(gray, np.uint8)
    yield np.asarray(cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8)).apply(gray), np.uint8)


def _box_sizes(registered: Registration, focal_px: float) -> tuple[float, float]:
    """Bound a face's width in pixels by the depths in the scene."""
    z = registered.color_depth[registered.color_depth > 0]
    if not len(z):
        raise NoDepthError("no depth lies before the colour camera: is the calibration right?")
    nearest, farthest = (float(value) for value in np.percentile(z, (1, 99)))
    farthest = min(farthest, _FARTHEST_MM)
    nearest = min(max(nearest, _NEAREST_MM), farthest)
    return focal_px * FACE_WIDTH_MM[0] / farthest, focal_px * FACE_WIDTH_MM[1] / nearest


def _scaled(box: Box, factor: float) -> Box:
    x, y, w, h = (round(side * factor) for side in box)
    return x, y, w, h


def _weigh(
    box: Box, registered: Registration, focal_px: float
) -> FaceCandidate:
    """Judge a box by the depth in its middle."""
    x, y, w, h = box
    u, v = registered.pixels[..., 0], registered.pixels[..., 1]
    middle = registered.visible & (np.abs(u - (x + w / 2)) < _MIDDLE / 2 * w) & (
        np.abs(v - (y + h / 2)) < _MIDDLE / 2 * h)
    z = registered.color_depth[middle]
    if len(z) < _LEAST_MIDDLE_SHARE * _expected(registered, w * h * _MIDDLE**2):
        return FaceCandidate(box=box, depth_mm=None, width_mm=None, verdict="no depth")
    depth = float(np.median(z))
    width = w * depth / focal_px
    fits = FACE_WIDTH_MM[0] <= width <= FACE_WIDTH_MM[1]
    verdict = "face" if fits else "not a face's size at its depth"
    return FaceCandidate(box=box, depth_mm=depth, width_mm=width, verdict=verdict)


def _expected(registered: Registration, color_area: float) -> float:
    """How many depth pixels would cover an area of the colour image."""
    height, width = registered.valid.shape
    u = registered.pixels[..., 0][registered.visible]
    v = registered.pixels[..., 1][registered.visible]
    if len(u) < 2:
        return color_area
    covered = max(1.0, float(np.ptp(u)) * float(np.ptp(v)))
    return color_area * min(1.0, float(height * width) / covered)


def _choose(faces: list[FaceCandidate], seen: list[FaceCandidate]) -> Detection:
    nearest = min(faces, key=lambda c: c.depth_mm or np.inf)
    others = sorted((c for c in seen if c is not nearest), key=lambda c: c.depth_mm or np.inf)
    candidates = [nearest.model_copy(update={"verdict": "chosen"})] + [
        c.model_copy(update={"verdict": "farther"}) if c.verdict == "face" else c for c in others]
    return Detection(nearest.box, nearest.depth_mm or 0.0, tuple(candidates))
