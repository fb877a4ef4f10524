"""Faces looked for ten times a second: one pass of a cascade at a time, where depth allows a face.

`detect_face` goes on until it has a face, and without one pays for every pass. Who looks at each
frame of a stream need not: what one pass misses, the next frame's finds.
"""

from typing import NamedTuple

import cv2
import numpy as np

from denseface.recon.arrays import Bytes
from denseface.recon.detection._cascades import CenterMask, run_pass
from denseface.recon.detection._detect import Search
from denseface.recon.detection._head_regions import head_regions
from denseface.recon.detection._passes import FINE, PROFILES, STRAIGHT, TIPPED
from denseface.recon.detection._regions import CELLS, Region
from denseface.recon.face import FaceCandidate
from denseface.recon.intermediate import Registration

_SEARCHES = (STRAIGHT, PROFILES[0], STRAIGHT, PROFILES[1], FINE, TIPPED[0], STRAIGHT, TIPPED[1])
"""The passes in turn: a face that looks at the camera waits for no more than two frames."""
_FOLLOWING = STRAIGHT._replace(min_neighbors=2)
"""Where a face is known to be, less evidence is enough."""
_FOLLOWED_SHIFT = 0.6
"""How far the centre of a face may be from where it was, by the width of its box."""
_FOLLOWED_DEPTH = 0.15
"""How far its depth may be from what it was, as a share."""
_FOLLOWED_MARGIN = 1.3
"""Half the side of the part of the image that is searched, by the width of the box."""
_COARSE = STRAIGHT._replace(face_px=28.0, scale_step=1.18)
"""Where a hint is given alone: that a face fills the image, or is there in turned images."""
_TURNED_MM = 1300.0
"""In turned images no face is looked for farther away."""
_CLOSE_WIDTHS = 0.3, 1.0
"""Narrowest box of a face that is too near, by the image's width, and widest, by its height: at
400 mm a Kinect's image is 490 mm wide."""
_SAME_CENTER = 0.5
"""Boxes whose centres are nearer than this, by their widths, are of one face."""


class Looked(NamedTuple):
    """What one look found."""

    faces: tuple[FaceCandidate, ...]
    """One for each person, the nearest first."""
    frontal: bool
    """Whether the pass was for faces that look ahead; False for turned ones."""
    searched: bool
    """Whether depth left any place where a cascade had to look."""


class Followed(NamedTuple):
    """A face that was found again."""

    face: FaceCandidate
    frontal: bool
    """As of `Looked`."""


def look_for_faces(
    color: Bytes, registered: Registration, focal_px: float, turn: int, farthest_mm: float
) -> Looked:
    """Look with one of the passes wherever depth bulges like a face.

    Parameters
    ----------
    color : (H', W', 3) uint8, RGB
    registered : the depth tied to that image; every k-th pixel is enough
    focal_px : focal length of the colour camera, pixels
    turn : which of the passes: counts up from look to look
    farthest_mm : what is farther is left out

    Raises
    ------
    NoDepthError
        Where nothing measured lies before the colour camera.
    """
    search = Search(color, registered, focal_px)
    regions = head_regions(search.cells, farthest_mm)
    one = _SEARCHES[turn % len(_SEARCHES)]
    found = [face for region in regions for face in search.faces_in(one, region)]
    return Looked(_each_once(found), one not in PROFILES, bool(regions))


def follow_face(
    color: Bytes, registered: Registration, focal_px: float, last: FaceCandidate, turn: int
) -> Followed | None:
    """Find a face again near where it was, or None; parameters are those of `look_for_faces`.

    Where the first pass does not see it, one of the others looks, in turn.
    """
    if last.depth_mm is None:
        return None
    search = Search(color, registered, focal_px)
    region = _around(last, last.depth_mm, search.shape)
    others = _SEARCHES[1 + turn % (len(_SEARCHES) - 1)]
    for one in (_FOLLOWING, others):
        faces = search.faces_in(one, region)
        if faces:
            return Followed(min(faces, key=lambda face: _apart(face, last)), one not in PROFILES)
    return None


def turned_by(color: Bytes, registered: Registration, focal_px: float) -> int | None:
    """Give by how many degrees, clockwise, the images are to be turned for a face to be seen.

    Parameters are those of `detect_face`; None where no quarter turns show a face.
    """
    search = Search(color, registered, focal_px)
    near = [region for region in search.regions if region.near_mm < _TURNED_MM]
    for degrees in (90, 180, 270):
        if search.nearest_face((_COARSE._replace(roll=-float(degrees)),), near, search.as_taken):
            return degrees
    return None


def close_face(color: Bytes) -> bool:
    """Say whether the image shows a face so wide that it must be too near for any depth.

    color : (H, W, 3) uint8, RGB
    """
    gray = np.asarray(cv2.cvtColor(color, cv2.COLOR_RGB2GRAY), np.uint8)
    height, width = gray.shape
    limits = _CLOSE_WIDTHS[0] * width, _CLOSE_WIDTHS[1] * height
    everywhere = CenterMask(np.ones((1, 1), np.bool_), float(max(width, height)))
    return bool(run_pass(gray, (0, 0, width, height), _COARSE, limits[0], limits, everywhere))


def _around(last: FaceCandidate, depth_mm: float, shape: tuple[int, int]) -> Region:
    """Give the surroundings of a box as a region to search."""
    x, y, w, h = last.box
    u, v, height, width = x + w / 2, y + h / 2, *shape
    left, right = (round(min(max(u + side * w, 0), width)) for side in
                   (-_FOLLOWED_MARGIN, _FOLLOWED_MARGIN))
    top, bottom = (round(min(max(v + side * w, 0), height)) for side in
                   (-_FOLLOWED_MARGIN, _FOLLOWED_MARGIN))
    cell = width / CELLS
    centers = np.zeros((int(np.ceil(height / cell)), CELLS), np.bool_)
    first_row, last_row, first, past = (
        round(min(max(side / cell, 0), CELLS)) for side in
        (v - _FOLLOWED_SHIFT * w, v + _FOLLOWED_SHIFT * w,
         u - _FOLLOWED_SHIFT * w, u + _FOLLOWED_SHIFT * w))
    centers[first_row:last_row + 1, first:past + 1] = True
    return Region((left, top, max(right - left, 1), max(bottom - top, 1)),
                  depth_mm * (1 - _FOLLOWED_DEPTH), depth_mm * (1 + _FOLLOWED_DEPTH), centers)


def _each_once(faces: list[FaceCandidate]) -> tuple[FaceCandidate, ...]:
    kept: list[FaceCandidate] = []
    for face in sorted(faces, key=lambda face: face.depth_mm or np.inf):
        if all(_apart(face, other) > _SAME_CENTER for other in kept):
            kept.append(face)
    return tuple(kept)


def _apart(a: FaceCandidate, b: FaceCandidate) -> float:
    """Give the distance of two boxes' centres by the wider one's width."""
    (ax, ay, aw, ah), (bx, by, bw, bh) = a.box, b.box
    return float(np.hypot(ax + aw / 2 - bx - bw / 2, ay + ah / 2 - by - bh / 2) / max(aw, bw, 1))
