"""Stage 2: the face in the colour image, by Haar cascades, confirmed by its depth."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.detection._cascades import Look, Middles, look_for_faces
from denseface.recon.detection._contrast import evened
from denseface.recon.detection._kernels import depths_in_box, middle_depths
from denseface.recon.detection._regions import CELLS, Region, regions_by_depth, without_flat
from denseface.recon.detection._relief import bulge_mm
from denseface.recon.errors import FaceWithoutDepthError, NoFaceError
from denseface.recon.face import Box, FaceCandidate
from denseface.recon.intermediate import Registration
from denseface.recon.numerics.percentile import percentile

__all__ = ["FACE_WIDTH_MM", "Detection", "detect_face", "judge_box"]

FACE_WIDTH_MM = (110.0, 210.0)
"""How wide a cascade's box around a face is, child to large adult, hair included."""

_ORDINARY_MM = 160.0
# What bulges less, from the middle of its box to the sides, is flat: the least of 120 simulated
# faces has 9 mm (a hand at its cheek), the next 14; cupboards and walls up to 6.6.
_LEAST_BULGE_MM = 7.5

# Viola and Jones, 2001, doi:10.1109/CVPR.2001.990517.
_ALT2 = "haarcascade_frontalface_alt2"
_PROFILE = "haarcascade_profileface"
# The profile cascade's box is so much wider than the frontal ones' around the same head.
_PROFILE_WIDER = 1.09

# A third of the resolution for a face at 0.8 m, half of it, two thirds.
_THIRD, _HALF, _FINE = 28.0, 42.0, 60.0
_ROLLED_PX, _PROFILE_PX = 36.0, 34.0
_FIRST = Look(_ALT2, _THIRD, 1.18, 3)
_ANYWHERE = Look(_ALT2, _THIRD, 1.2, 3)
_SECOND = Look(_ALT2, _HALF)
_ROLLED = tuple(Look(_ALT2, _ROLLED_PX, 1.15, 3, roll=degrees) for degrees in (-30, 30, -15, 15))
_PROFILES = tuple(Look(_PROFILE, _PROFILE_PX, 1.05, 6, mirrored=way) for way in (False, True))
# The first look by which depth confirms a face ends the search: most faces are found by the first,
# the others see those that it misses (turned, tipped, lit from the side).
_LAST = Look(_ALT2, _FINE, 1.07)
_LADDER = (_FIRST, _SECOND, *_ROLLED, *_PROFILES, _LAST)
# With the contrast evened out, for faces in the dark, before a bright wall or lit aslant. The
# profile cascade takes the back of an ear for a face there.
_EVENED_LADDER = (_FIRST, _SECOND, *_ROLLED, _LAST)
# What stands this much nearer than the face found is searched once more, by so many looks.
_NEARER_MM = 10.0
# What is below a face and not so much nearer is its own body.
_BODY_MM = 100.0
_NEARER_LOOKS = (_SECOND, *_ROLLED[:2], *_PROFILES)
_NEARER_EVENED = (_SECOND, *_ROLLED[:2], _LAST)
# The box found small is sought again at full size, about its own middle, as wide as a face is at
# its depth: its own width is that of a few coarse steps.
_REFINED_STEP, _REFINED_NEIGHBORS = 1.08, 2
_REFINED_MM = (120.0, 205.0)
_REFINED_OFF = 0.1
# The cascades were trained on 20-24 pixel faces and gain nothing beyond this width of the image.
_WIDEST = 640
# The middle of a box, where a face has depth: half of it each way.
_MIDDLE = 0.5
_LEAST_MIDDLE_SHARE = 0.1


@dataclass(frozen=True)
class Detection:
    """The chosen box with its depth, and all boxes that were weighed.

    Attributes
    ----------
    box : x, y, width, height; pixels of the colour image; upright, about the middle of the face,
        however the head is tipped
    depth_mm : median z, in the colour camera's frame, in the middle of the box
    candidates : every box, the chosen one first, then by depth
    """

    box: Box
    depth_mm: float
    candidates: tuple[FaceCandidate, ...]


def detect_face(
    color: NDArray[np.uint8], registered: Registration, focal_px: float
) -> Detection:
    """Find the nearest face whose size and shape fit its depth.

    The scene is searched from the nearest layer of depth to the farthest, at most 2 m, and no
    further than to the first face.

    Parameters
    ----------
    color : (H', W', 3) uint8, RGB
    registered : the depth tied to that image; every k-th pixel is enough
    focal_px : focal length of the colour camera, pixels

    Raises
    ------
    NoFaceError
        Where no box was found, or none is a face's size and shape at its depth.
    FaceWithoutDepthError
        Where faces were seen but nothing was measured on them.
    NoDepthError
        Where nothing measured lies before the colour camera.
    """
    search = _Search(color, registered, focal_px)
    for even, ladder in ((False, _LADDER), (True, _EVENED_LADDER)):
        for look in ladder:
            found = search.nearest(look, search.regions, even=even)
            if found:
                return search.detection(search.nearer_than(found.face) or found)
            if look is _FIRST and not even:
                search.leave_out_flat()
    search.anywhere()
    raise search.failure()


class _Found(NamedTuple):
    """A face, and how it was seen: in which image, by which look."""

    face: FaceCandidate
    gray: NDArray[np.uint8]
    look: Look


class _Search:
    """One frame's search: the image, where to look, and what was seen."""

    def __init__(
        self, color: NDArray[np.uint8], registered: Registration, focal_px: float
    ) -> None:
        self.registered = registered
        self.focal_px = focal_px
        self.seen: list[FaceCandidate] = []
        gray = cv2.cvtColor(color, cv2.COLOR_RGB2GRAY)
        shrink = min(1.0, _WIDEST / color.shape[1])
        if shrink < 1:
            gray = cv2.resize(gray, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
        self.gray = np.asarray(gray, np.uint8)
        self.to_color = color.shape[1] / gray.shape[1]
        self.shape = color.shape[:2]
        self.regions = regions_by_depth(registered, self.shape, focal_px)
        self._evened: dict[tuple[Box, float, float], NDArray[np.uint8]] = {}

    def leave_out_flat(self) -> None:
        """From now on look only where depth bulges."""
        self.regions = without_flat(self.regions, self.registered, self.shape, self.focal_px)

    def evened(self, region: Region) -> NDArray[np.uint8]:
        """Give the image with the contrast of a region evened out, by what is at its depth."""
        key = (region.part, region.near_mm, region.far_mm)
        if key not in self._evened:
            part = _scaled(region.part, 1 / self.to_color)
            self._evened[key] = evened(self.gray, part, self._brightness(region))
        return self._evened[key]

    def nearest(
        self, look: Look, regions: Iterable[Region], *, even: bool = False
    ) -> _Found | None:
        """Give the nearest face of the nearest region that has any."""
        for region in regions:
            small, large = FACE_WIDTH_MM
            ordinary = self.focal_px * _ORDINARY_MM / np.sqrt(region.near_mm * region.far_mm)
            sizes = (self.focal_px * small / region.far_mm, self.focal_px * large / region.near_mm)
            middles = Middles(region.middles, self.gray.shape[1] / CELLS)
            gray = self.evened(region) if even else self.gray
            weighed = self._look(gray, region.part, look, ordinary, sizes, middles)
            self.seen += weighed
            faces = [c for c in weighed if c.verdict == "face"]
            if faces:
                return _Found(min(faces, key=_depth), gray, look)
        return None

    def nearer_than(self, found: FaceCandidate) -> _Found | None:
        """Look again, in other ways, at what stands before a face and is not its own body."""
        nearer = regions_by_depth(self.registered, self.shape, self.focal_px,
                                  _depth(found) - _NEARER_MM)
        x, y, w, h = (side * CELLS / self.shape[1] for side in found.box)
        left, top, right, bottom = (max(round(side), 0) for side in (x, y, x + w, y + h))
        for region in nearer:
            region.middles[top:bottom, left:right] = False
            if region.far_mm > _depth(found) - _BODY_MM:
                region.middles[bottom:, max(round(x - w / 2), 0):round(x + 1.5 * w)] = False
        if nearer:
            nearer = without_flat(nearer, self.registered, self.shape, self.focal_px)
        for even, looks in ((False, _NEARER_LOOKS), (True, _NEARER_EVENED)):
            for look in looks if nearer else ():
                missed = self.nearest(look, nearer, even=even)
                if missed and _depth(missed.face) < _depth(found):
                    return missed
        return None

    def detection(self, seen: _Found) -> Detection:
        """Give the result, with the box sought again with less rounding."""
        found, gray, look = seen
        wider = _PROFILE_WIDER if look.cascade == _PROFILE else 1.0
        small, large = (wider * self.focal_px * mm / _depth(found) for mm in _REFINED_MM)
        x, y, w, h = found.box
        off = _REFINED_OFF * w
        around = round(large / 2 + off)
        u, v = x + w / 2, y + h / 2
        height, width = (round(side * self.to_color) for side in gray.shape)
        left, top = max(round(u) - around, 0), max(round(v) - around, 0)
        part = (left, top, min(round(u) + around, width) - left,
                min(round(v) + around, height) - top)
        again = look._replace(face_px=np.inf, scale_step=_REFINED_STEP,
                              min_neighbors=_REFINED_NEIGHBORS)
        middle = Middles(np.ones((1, 1), np.bool_), 2 * off / self.to_color,
                         (u - off) / self.to_color, (v - off) / self.to_color)
        refined = [c for c in self._look(gray, part, again, wider * w, (small, large), middle)
                   if c.verdict == "face"]
        chosen = max(refined, key=lambda c: c.box[2]) if refined else found
        others = sorted((c for c in self.seen if c is not found), key=_depth)
        candidates = (chosen.model_copy(update={"verdict": "chosen"}), *(
            c.model_copy(update={"verdict": "farther"}) if c.verdict == "face" else c
            for c in others))
        return Detection(chosen.box, _depth(chosen), candidates)

    def anywhere(self) -> None:
        """Look at the whole image, so that what is no face at its depth can be named."""
        height, width = (round(side * self.to_color) for side in self.gray.shape)
        self.seen += self._look(self.gray, (0, 0, width, height), _ANYWHERE,
                                3 * _ANYWHERE.face_px * self.to_color, (0.0, float(height)),
                                Middles(np.ones((1, 1), np.bool_), float(width)))

    def failure(self) -> NoFaceError | FaceWithoutDepthError:
        """Say why there is no face."""
        measured = [c for c in self.seen if c.depth_mm is not None]
        if not self.seen:
            return NoFaceError("no face found in the colour image")
        if not measured:
            return FaceWithoutDepthError(
                f"face seen at {self.seen[0].box}, but no depth was measured on it")
        return NoFaceError(f"no face found: {_why_not(measured[-1])}")

    def _brightness(self, region: Region) -> NDArray[np.uint8]:
        """How bright what was measured in a region is."""
        registered = self.registered
        there = (registered.visible & (registered.color_depth >= region.near_mm)
                 & (registered.color_depth < region.far_mm))
        u, v = (registered.pixels[there] / np.float32(self.to_color)).astype(np.int32).T
        x, y, w, h = _scaled(region.part, 1 / self.to_color)
        inside = (u >= x) & (u < x + w) & (v >= y) & (v < y + h)
        return np.asarray(self.gray[v[inside], u[inside]], np.uint8)

    def _look(
        self, gray: NDArray[np.uint8], part: Box, look: Look, ordinary: float,
        sizes: tuple[float, float], middles: Middles,
    ) -> list[FaceCandidate]:
        """Look at a part of the colour image and weigh what is there."""
        shrink = 1 / self.to_color
        found = look_for_faces(gray, _scaled(part, shrink), look, ordinary * shrink,
                               (sizes[0] * shrink, sizes[1] * shrink), middles)
        narrower = 1 / _PROFILE_WIDER if look.cascade == _PROFILE else 1.0
        return [judge_box(_about_middle(_scaled(box, self.to_color), narrower), self.registered,
                          self.focal_px) for box in found]


def judge_box(box: Box, registered: Registration, focal_px: float) -> FaceCandidate:
    """Judge a detector's box by the depth in it.

    Parameters
    ----------
    box : x, y, width, height; pixels of the colour image
    registered : the depth tied to that image; every k-th pixel is enough
    focal_px : focal length of the colour camera, pixels
    """
    x, y, w, h = box
    depths = depths_in_box(registered.pixels, registered.color_depth, registered.visible,
                           float(x), float(y), float(w), float(h))
    z = middle_depths(depths, _MIDDLE)
    if len(z) < _LEAST_MIDDLE_SHARE * w * h * (_MIDDLE / registered.z_buffer.pitch)**2:
        return FaceCandidate(box=box, depth_mm=None, width_mm=None, verdict="no depth")
    depth = percentile(z, 50)
    width = w * depth / focal_px
    verdict = "face"
    if not FACE_WIDTH_MM[0] <= width <= FACE_WIDTH_MM[1]:
        verdict = "not a face's size at its depth"
    elif bulge_mm(depths, depth) < _LEAST_BULGE_MM:
        verdict = "flat"
    return FaceCandidate(box=box, depth_mm=depth, width_mm=width, verdict=verdict)


def _depth(candidate: FaceCandidate) -> float:
    return np.inf if candidate.depth_mm is None else candidate.depth_mm


def _why_not(candidate: FaceCandidate) -> str:
    if candidate.verdict == "flat":
        return f"what the box at {candidate.box} shows is flat"
    return (f"the box at {candidate.box} is {candidate.width_mm:.0f} mm wide at its depth, a face "
            f"is {FACE_WIDTH_MM[0]:.0f}-{FACE_WIDTH_MM[1]:.0f} mm")


def _scaled(box: Box, factor: float) -> Box:
    x, y, w, h = (round(side * factor) for side in box)
    return x, y, w, h


def _about_middle(box: Box, factor: float) -> Box:
    """The same box, wider or narrower about its middle."""
    x, y, w, h = box
    wide, high = round(w * factor), round(h * factor)
    return x + round((w - wide) / 2), y + round((h - high) / 2), wide, high
