"""The face in depth alone: cascades on its relief, drawn from the front of turned heads too."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import cv2
import numpy as np

from denseface.capture.calibration import CameraModel
from denseface.capture.frame import RgbdFrame
from denseface.recon.arrays import Bools, Floats
from denseface.recon.detection._cascades import CascadePass, CenterMask, run_pass
from denseface.recon.detection._detect import (
    FACE_WIDTH_MM,
    TYPICAL_WIDTH_MM,
    Detection,
    detection_of,
    judge_new,
    why_none,
)
from denseface.recon.detection._head_regions import MAYBE, HeadScore, likeness
from denseface.recon.detection._passes import FRONTAL, PROFILE
from denseface.recon.detection._regions import (
    CELLS,
    Region,
    nearest_by_cell,
    regions_by_depth,
    without_flat,
)
from denseface.recon.detection._views import PIXEL_MM, Layer, turned
from denseface.recon.face import Box, FaceCandidate
from denseface.recon.intermediate import NO_DEPTH_MM, Registration

_PASS = CascadePass(FRONTAL, TYPICAL_WIDTH_MM / PIXEL_MM, min_neighbors=2)
"""One scale for all distances. Fewer boxes than in colour must agree: nothing in these pictures is
painted."""
_PROFILE = CascadePass(PROFILE, TYPICAL_WIDTH_MM / PIXEL_MM, 1.05, 2)
_WIDER, _PROFILE_WIDER = 1.075, 1.17
"""A box by the one around the same head in colour: 175 mm in the mean instead of 163, of a profile
1.09 as much again."""


class _Look(NamedTuple):
    """Which cascade looks, from where."""

    yaw: float = 0.0
    """Degrees, of the head that is seen from its front."""
    pitch: float = 0.0
    roll: float = 0.0
    cascade_pass: CascadePass = _PASS


_LOOKS = (
    _Look(), _Look(pitch=25.0), _Look(pitch=-25.0), _Look(roll=30.0), _Look(roll=-30.0),
    _Look(yaw=40.0), _Look(yaw=-40.0), _Look(yaw=-15.0, cascade_pass=_PROFILE),
    _Look(yaw=15.0, cascade_pass=_PROFILE._replace(mirrored=True)))
"""In turn, until there is a face."""
_EVERYWHERE = 3
"""So many of them look wherever a head can be, the others where it is likely: lifted and lowered
faces look least like the mean face."""
_BESIDE_MM, _ABOVE_MM, _DEEPER_MM = 140.0, 200.0, 50.0
"""So far beside a face's middle, both ways, and above it, there is nothing, or something so much
deeper, or a shadow."""
_PIECE_MM = 70.0
"""Side of the square that a connected piece of such places covers at least; the least of 93 faces
is 118. Both tests leave 20 % of the places that bulge where there is a face, and 5-15 % of those in
rooms and on tables."""


class _Hit(NamedTuple):
    face: FaceCandidate
    region: int


def detect_by_depth(
    frame: RgbdFrame, registered: Registration, rejected: tuple[Box, ...] = (), *,
    ahead_only: bool = False, score: HeadScore | None = None, places: Bools | None = None,
) -> Detection:
    """Find the nearest face by the shape of depth.

    As `detect_face` does, from the nearest layer of depth to the farthest.

    Parameters
    ----------
    frame : one without colour
    registered : its depth tied to the depth camera itself; every k-th pixel is enough
    rejected : as of `detect_face`
    ahead_only : look for upright faces that look ahead, and no others
    score : tells where more than the first looks are worth it; None: wherever a head can be
    places : of any size, which parts of the depth image the middle of a face may be in; None: all

    Raises
    ------
    NoFaceError
        Where nothing has the shape of a face, or nothing of that shape its size.
    NoDepthError
        Where nothing measured lies before the camera.
    """
    camera = frame.depth_camera
    shape = camera.height, camera.width
    nearest = nearest_by_cell(registered, shape)
    free = _standing_free(regions_by_depth(registered, shape, camera.fx), nearest, camera)
    if places is not None:
        free = _within(free, places)
    regions = _without_small(without_flat(free, nearest, shape, camera.fx), camera)
    search = _Search(_depth_mm(frame), camera, regions, partial(
        judge_new, registered=registered, focal_px=camera.fx, rejected=rejected))
    hit: _Hit | None = None
    for number, look in enumerate(_LOOKS[:1] if ahead_only else _LOOKS):
        # What a later view finds nearer wins.
        count = len(regions) if hit is None else hit.region
        if number == _EVERYWHERE and score is not None:
            search.skipped = {which for which in range(count) if not _is_likely(
                regions[which], nearest, registered, camera, score)}
        hit = search.nearest_face(look, count) or hit
    if hit is None:
        raise why_none(search.candidates, "by the depth's shape")
    return detection_of(hit.face, [c for c in search.candidates if c is not hit.face])


def _depth_mm(frame: RgbdFrame) -> Floats:
    """Give the depth image in mm, 0 where nothing was measured."""
    meaning = frame.depth_meaning
    depth = frame.depth * np.float32(meaning.unit_um / 1000)
    depth[frame.depth > meaning.max_count] = 0
    return depth


class _Search:
    """One frame's search, and the candidates so far."""

    def __init__(
        self, depth_mm: Floats, camera: CameraModel, regions: list[Region],
        judge: Callable[[Box], FaceCandidate],
    ) -> None:
        self.candidates: list[FaceCandidate] = []
        self.skipped: set[int] = set()
        """Regions that are not looked at any more, by their number."""
        self._depth_mm = depth_mm
        self._camera = camera
        self._regions = regions
        self._judge = judge
        self._layers: dict[int, Layer] = {}

    def nearest_face(self, look: _Look, count: int) -> _Hit | None:
        """Give the nearest face of the nearest of the first `count` regions that has any."""
        for number, region in enumerate(self._regions[:count]):
            if number in self.skipped:
                continue
            if number not in self._layers:
                self._layers[number] = Layer(self._depth_mm, self._camera, region)
            found = [self._judge(box) for box in _boxes(self._layers[number], look, self._camera)]
            self.candidates += found
            faces = [candidate for candidate in found if candidate.verdict == "face"]
            if faces:
                return _Hit(min(faces, key=lambda face: face.depth_mm or np.inf), number)
        return None


def _boxes(layer: Layer, look: _Look, camera: CameraModel) -> list[Box]:
    """Give what looks like a face in one view, in pixels of the depth image."""
    view = layer.view(turned(look.yaw, look.pitch, look.roll))
    if view is None:
        return []
    small, large = FACE_WIDTH_MM
    wider = _WIDER if look.cascade_pass.cascade == FRONTAL else _PROFILE_WIDER
    height, width = view.grey.shape
    boxes = []
    for (x, y, w, h), _ in run_pass(view.grey, (0, 0, width, height), look.cascade_pass,
                                   TYPICAL_WIDTH_MM / PIXEL_MM,
                                   (wider * small / PIXEL_MM, wider * large / PIXEL_MM),
                                   CenterMask(view.centers, 1.0)):
        place = layer.place(view, x + w / 2, y + h / 2)
        if place is not None:
            u, v, depth = place
            side = w / wider * PIXEL_MM * camera.fx / depth
            boxes.append((round(u - side / 2), round(v - side / 2), round(side), round(side)))
    return boxes


def _standing_free(
    regions: list[Region], nearest: Floats, camera: CameraModel
) -> list[Region]:
    """Keep only centres beside and above which nothing is as near."""
    rows, columns = len(nearest), CELLS
    remaining = []
    for region in regions:
        beside, above = (max(1, round(side / _cell_mm(region, camera)))
                         for side in (_BESIDE_MM, _ABOVE_MM))
        around = np.pad(nearest, ((above, 0), (beside, beside)), constant_values=NO_DEPTH_MM)
        least = np.minimum(around[above:, :columns], around[above:, 2 * beside:])
        least = np.minimum(least, around[:rows, beside:beside + columns])
        free = region.centers & (least > nearest + np.float32(_DEEPER_MM))
        if free.any():
            remaining.append(region._replace(centers=free))
    return remaining


def _within(regions: list[Region], places: Bools) -> list[Region]:
    """Keep only centres in some places."""
    remaining = []
    for region in regions:
        allowed = cv2.resize(places.view(np.uint8), region.centers.shape[::-1],
                             interpolation=cv2.INTER_NEAREST).view(np.bool_)
        centers = region.centers & allowed
        if centers.any():
            remaining.append(region._replace(centers=centers))
    return remaining


def _without_small(regions: list[Region], camera: CameraModel) -> list[Region]:
    """Keep only centres in pieces large enough for a face's middle."""
    remaining = []
    for region in regions:
        _, pieces, stats, _ = cv2.connectedComponentsWithStats(
            region.centers.view(np.uint8), connectivity=8)
        large = stats[:, cv2.CC_STAT_AREA] * _cell_mm(region, camera) ** 2 >= _PIECE_MM**2
        large[0] = False
        if large.any():
            remaining.append(region._replace(centers=large[pieces]))
    return remaining


def _is_likely(
    region: Region, nearest: Floats, registered: Registration, camera: CameraModel,
    score: HeadScore,
) -> bool:
    """Say whether a piece of a region's centres may be a face's by its score."""
    count, pieces = cv2.connectedComponents(region.centers.view(np.uint8), connectivity=8)
    for piece in range(1, count):
        centers = pieces == piece
        depths = nearest[centers]
        range_mm = (max(region.near_mm, float(depths.min())),
                    min(region.far_mm, float(depths.max())))
        if likeness(registered, centers, range_mm, camera.width / CELLS, camera.fx,
                    score) >= MAYBE:
            return True
    return False


def _cell_mm(region: Region, camera: CameraModel) -> float:
    """Give the side of a cell at the depth of a region."""
    return float(np.sqrt(region.near_mm * region.far_mm)) / camera.fx * camera.width / CELLS
