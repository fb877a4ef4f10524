"""Stage 2: the face in the colour image, by Haar cascades, confirmed by its depth."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import FaceWithoutDepthError, NoDepthError, NoFaceError
from recon.face import FaceCandidate
from recon.registration import Registration

__all__ = ["FACE_WIDTH_MM", "Detection", "detect_face", "find_boxes"]

FACE_WIDTH_MM = (110.0, 210.0)
"""How wide a cascade's box around a face is, child to large adult, hair included."""

# Viola and Jones, 2001, doi:10.1109/CVPR.2001.990517. The first that depth confirms ends the
# search; those after it see faces that it misses (turned, lit from the side).
_CASCADES = ("haarcascade_frontalface_alt2", "haarcascade_frontalface_default",
             "haarcascade_frontalface_alt")
_SCALE_STEP = 1.1
_MIN_NEIGHBORS = 5
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

    box: tuple[int, int, int, int]
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
    scale = min(1.0, _WIDEST / color.shape[1])
    smallest, largest = _box_sizes(registered, focal_px)
    seen: list[FaceCandidate] = []
    for gray in _grays(color, scale):
        for cascade in _CASCADES:
            boxes = find_boxes(gray, cascade, smallest * scale, largest * scale)
            weighed = [_weigh(_unscaled(box, scale), registered, focal_px) for box in boxes]
            seen += weighed
            faces = [c for c in weighed if c.verdict == "face"]
            if faces:
                return _choose(faces, seen)
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
    gray: NDArray[np.uint8], cascade: str, smallest: float, largest: float
) -> list[tuple[int, int, int, int]]:
    """Run one cascade over a (H, W) uint8 image for boxes between two widths, pixels."""
    low, high = max(20, int(smallest)), max(20, int(np.ceil(largest)))
    found = _cascade(cascade).detectMultiScale(
        gray, scaleFactor=_SCALE_STEP, minNeighbors=_MIN_NEIGHBORS,
        minSize=(low, low), maxSize=(high, high))
    return [(int(x), int(y), int(w), int(h)) for x, y, w, h in found]


@lru_cache
def _cascade(name: str) -> cv2.CascadeClassifier:
    path = Path(cv2.__file__).parent / "data" / f"{name}.xml"
    classifier = cv2.CascadeClassifier(str(path))
    if classifier.empty():
        raise RuntimeError(f"{path}: OpenCV ships no such cascade (version 5 has none)")
    return classifier


def _grays(color: NDArray[np.uint8], scale: float) -> list[NDArray[np.uint8]]:
    """The image as it is, then with its contrast evened out for faces in the dark or lit aslant."""
    gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
    if scale < 1:
        gray = cv2.resize(gray, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    even = cv2.createCLAHE(clipLimit=4.0, tileGridSize=(8, 8)).apply(gray)
    return [np.asarray(gray, np.uint8), np.asarray(even, np.uint8)]


def _box_sizes(registered: Registration, focal_px: float) -> tuple[float, float]:
    """Bound a face's width in pixels by the depths in the scene."""
    z = registered.color_depth[registered.color_depth > 0]
    if not len(z):
        raise NoDepthError("no depth lies before the colour camera: is the calibration right?")
    nearest, farthest = (float(value) for value in np.percentile(z, (1, 99)))
    farthest = min(farthest, _FARTHEST_MM)
    nearest = min(max(nearest, _NEAREST_MM), farthest)
    return focal_px * FACE_WIDTH_MM[0] / farthest, focal_px * FACE_WIDTH_MM[1] / nearest


def _unscaled(box: tuple[int, int, int, int], scale: float) -> tuple[int, int, int, int]:
    x, y, w, h = (round(side / scale) for side in box)
    return x, y, w, h


def _weigh(
    box: tuple[int, int, int, int], registered: Registration, focal_px: float
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
