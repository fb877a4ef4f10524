"""Stage 2: the face in the colour image, by Haar cascades, confirmed by its depth."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Bytes
from denseface.recon.detection._cascades import CascadePass, CenterMask, run_pass
from denseface.recon.detection._contrast import (
    equalize_contrast,
    gray_to_search,
    lift_shadows,
)
from denseface.recon.detection._head_regions import (
    LIKELY,
    MAYBE,
    HeadScore,
    Likely,
    depth_cells,
    head_regions,
    largest,
)
from denseface.recon.detection._kernels import depths_in_box
from denseface.recon.detection._passes import (
    EQUALIZED_RUNGS,
    LIFTED_RUNGS,
    NEARER_RUNGS,
    PROFILE,
    RUNGS,
    WHOLE_IMAGE,
    WHOLE_SHRINK,
    Rung,
)
from denseface.recon.detection._regions import CELLS, Region, resized, scaled
from denseface.recon.detection._relief import bulge_mm
from denseface.recon.errors import FaceWithoutDepthError, NoFaceError
from denseface.recon.face import Box, FaceCandidate
from denseface.recon.intermediate import Registration
from denseface.recon.numerics.percentile import percentile

FACE_WIDTH_MM = (110.0, 210.0)
"""How wide a cascade's box around a face is, child to large adult, hair included."""
TYPICAL_WIDTH_MM = 160.0
"""Width of an adult's box; passes choose their resolution by it."""
_MIN_BULGE_MM = 7.5
"""What bulges less, from the centre of its box to the sides, is flat. Of 120 simulated faces the
least has 9 mm (a hand at its cheek), the next 14; cupboards and walls up to 6.6."""

_NEARER_MM = 10.0
"""What is nearer than the face by this is searched again."""
_BODY_MM = 100.0
"""What is below the face and nearer by no more than this is its own body, and is not."""

_PROFILE_WIDER = 1.09
"""A profile cascade's box by a frontal one's around the same head."""

_FLAT, REJECTED = "flat", "no face by its shape"
"""Verdicts."""

_REFINED_STEP, _REFINED_NEIGHBORS = 1.08, 2
"""A box's width is that of a few coarse steps, so it is sought again at full resolution."""
_REFINED_MM = (120.0, 205.0)
"""Widths of the boxes that are sought then."""
_REFINED_SHIFT = 0.1
"""How far their centres may be from the box's own, each way, by its width."""
_DARK = 80
"""Grey level: where half of what is at a region's depth is brighter, equalised contrast is not
tried. Of 206 faces of the choosing heads the eight that only it shows have 23-40."""
_LAST_PLACES = 2
"""In so many of the largest places the last passes look: of 210 faces of the choosing heads 208 are
in the largest, the others in the second."""
_SAMPLE_STEP = 3
"""Every so many pixels tell how bright a region is at its depth."""
_CENTER = 0.5
"""Of a box, each way: where a face has depth."""
_MIN_CENTER_SHARE = 0.1
"""Of the pixels there that must have depth."""
_REJECTED_WIDTHS = 0.5
"""A box is of the same thing as a rejected one where their middles are nearer than this, each way,
by the rejected one's width."""


@dataclass(frozen=True)
class Detection:
    """The chosen box with its depth, and all boxes that were judged."""

    box: Box
    """x, y, width, height; pixels of the colour image; upright, however the head is tipped."""
    depth_mm: float
    """Median z, in the colour camera's frame, in the middle of the box."""
    candidates: tuple[FaceCandidate, ...]
    """Every box, the chosen one first, then by depth."""


def detect_face(
    color: Bytes, registered: Registration, focal_px: float, rejected: tuple[Box, ...] = (),
    score: HeadScore | None = None,
) -> Detection:
    """Find the nearest face whose size and shape fit its depth.

    The scene is searched from the nearest layer of depth to the farthest, at most 2 m, and no
    further than to the first face.

    Parameters
    ----------
    color : (H', W', 3) uint8, RGB
    registered : the depth tied to that image; every k-th pixel is enough
    focal_px : focal length of the colour camera, pixels
    rejected : boxes of what was found before and turned out to be no face: the search goes on to
        the next
    score : tells where all passes but the first are worth it; None: everywhere

    Raises
    ------
    NoFaceError
        Where no box was found, or none is a face's size and shape at its depth.
    FaceWithoutDepthError
        Where faces were seen but nothing was measured on them.
    NoDepthError
        Where nothing measured lies before the colour camera.
    """
    search = Search(color, registered, focal_px, rejected, score)
    for picture, rungs, least, most in (
            (search.as_taken, RUNGS[:1], 0.0, None),
            (search.as_taken, RUNGS[1:], MAYBE, None),
            (search.equalized, EQUALIZED_RUNGS, MAYBE, None),
            (search.lifted, LIFTED_RUNGS, LIKELY, _LAST_PLACES)):
        regions = search.likely.of(search.regions, least)
        if most is not None:
            regions = largest(regions, most)
        for rung in rungs:
            hit = search.nearest_face(rung, regions, picture)
            if hit:
                return search.detection(search.nearer_face(hit.face) or hit)
    raise search.failure()


def judge_box(box: Box, registered: Registration, focal_px: float) -> FaceCandidate:
    """Judge a cascade's box by the depth in it.

    Parameters
    ----------
    box : x, y, width, height; pixels of the colour image
    registered : the depth tied to that image; every k-th pixel is enough
    focal_px : focal length of the colour camera, pixels

    Returns
    -------
    a candidate whose verdict is `face`, or why it is none
    """
    x, y, w, h = box
    depths = depths_in_box(registered.pixels, registered.color_depth, registered.visible,
                           float(x), float(y), float(w), float(h))
    u, v, z = depths.T
    z = z[(np.abs(u) < _CENTER) & (np.abs(v) < _CENTER)]
    enough = _MIN_CENTER_SHARE * w * h * (_CENTER / registered.z_buffer.pitch)**2
    depth = percentile(z, 50) if len(z) and len(z) >= enough else np.inf
    width = w * depth / focal_px
    if not np.isfinite(width):  # nor is anything seen at the depths of an absurd calibration
        return FaceCandidate(box=box, depth_mm=None, width_mm=None, verdict="no depth")
    verdict = "face"
    if not FACE_WIDTH_MM[0] <= width <= FACE_WIDTH_MM[1]:
        verdict = "not a face's size at its depth"
    elif bulge_mm(depths, depth) < _MIN_BULGE_MM:
        verdict = _FLAT
    return FaceCandidate(box=box, depth_mm=depth, width_mm=width, verdict=verdict)


class _Hit(NamedTuple):
    """A face, and in which image and by which pass it was found."""

    face: FaceCandidate
    gray: Bytes
    cascade_pass: CascadePass


_Picture = Callable[[Region], Bytes | None]
"""Gives the version of the image in which a region is searched; None where it would not help."""


class Search:
    """One frame's search: the image, the regions to search, and the candidates so far."""

    def __init__(
        self, color: Bytes, registered: Registration, focal_px: float,
        rejected: tuple[Box, ...] = (), score: HeadScore | None = None,
    ) -> None:
        self.rejected = rejected
        self.registered = registered
        self.focal_px = focal_px
        self.candidates: list[FaceCandidate] = []
        # Before cells are made: those of a strip of two columns are many times its pixels.
        self.gray = gray_to_search(color)
        self.to_color = color.shape[1] / self.gray.shape[1]
        self.shape = color.shape[:2]
        self.cells = depth_cells(registered, self.shape, focal_px)
        self.regions = head_regions(self.cells)
        self.likely = Likely(registered, self.cells, score)
        self._lifted: Bytes | None = None
        self._equalized: dict[tuple[Box, float, float], Bytes | None] = {}

    def nearest_face(
        self, rung: Rung, regions: Iterable[Region], picture: _Picture
    ) -> _Hit | None:
        """Give the nearest face of the nearest region that has any.

        Of passes that see the same region, that one's whose box stands for most windows.
        """
        for region in regions:
            gray = picture(region)
            if gray is None:
                continue
            hits = []
            for one in rung:
                faces = self._seen_in(one, region, gray)
                if faces:
                    face, windows = min(faces, key=lambda seen: _depth(seen[0]))
                    hits.append((windows, _Hit(face, gray, one)))
            if hits:
                return max(hits, key=lambda hit: hit[0])[1]
        return None

    def faces_in(self, cascade_pass: CascadePass, region: Region) -> list[FaceCandidate]:
        """Give all that one pass takes for a face in a region."""
        return [face for face, _ in self._seen_in(cascade_pass, region, self.gray)]

    def _seen_in(
        self, cascade_pass: CascadePass, region: Region, gray: Bytes
    ) -> list[tuple[FaceCandidate, int]]:
        """Give each face that a pass sees in a version of the image, and its windows."""
        small, large = FACE_WIDTH_MM
        typical = self.focal_px * TYPICAL_WIDTH_MM / np.sqrt(region.near_mm * region.far_mm)
        sizes = (self.focal_px * small / region.far_mm, self.focal_px * large / region.near_mm)
        centers = CenterMask(region.centers, self.gray.shape[1] / CELLS)
        found = self._run(gray, region.roi, cascade_pass, typical, sizes, centers)
        self.candidates += [candidate for candidate, _ in found]
        return [seen for seen in found if seen[0].verdict == "face"]

    def nearer_face(self, found: FaceCandidate) -> _Hit | None:
        """Search, by other passes, what stands before a face and is not its own body."""
        x, y, w, h = (side * CELLS / self.shape[1] for side in found.box)
        left, top, right, bottom = (max(round(side), 0) for side in (x, y, x + w, y + h))
        nearer = []
        for region in self.regions:
            if region.near_mm > _depth(found) - _NEARER_MM:
                break
            centers = region.centers & (self.cells.nearest < _depth(found) - _NEARER_MM)
            centers[top:bottom, left:right] = False
            if region.far_mm > _depth(found) - _BODY_MM:
                centers[bottom:, max(round(x - w / 2), 0):round(x + 1.5 * w)] = False
            if centers.any():
                nearer.append(region._replace(centers=centers))
        nearer = self.likely.of(nearer, MAYBE, _depth(found) - _NEARER_MM)
        for picture, rungs in ((self.as_taken, NEARER_RUNGS), (self.equalized, EQUALIZED_RUNGS)):
            for rung in rungs if nearer else ():
                hit = self.nearest_face(rung, nearer, picture)
                if hit and _depth(hit.face) < _depth(found):
                    return hit
        return None

    def detection(self, hit: _Hit) -> Detection:
        """Give the result, with the box sought again at full resolution."""
        found = hit.face
        refined = [c for c in self._refine(hit) if c.verdict == "face"]
        chosen = max(refined, key=lambda c: c.box[2]) if refined else found
        return detection_of(chosen, [c for c in self.candidates if c is not found])

    def failure(self) -> NoFaceError | FaceWithoutDepthError:
        """Say why there is no face; what looks like one is sought in the whole image."""
        if not self.candidates:
            height, width = (round(side * self.to_color) for side in self.gray.shape)
            typical = WHOLE_SHRINK * WHOLE_IMAGE.face_px * self.to_color
            everywhere = CenterMask(np.ones((1, 1), np.bool_), float(width))
            self.candidates += [candidate for candidate, _ in self._run(
                self.gray, (0, 0, width, height), WHOLE_IMAGE, typical, (0.0, float(height)),
                everywhere)]
        return why_none(self.candidates, "in the colour image")

    def _refine(self, hit: _Hit) -> list[FaceCandidate]:
        """Give the boxes of a face's size at its depth, about the centre of the one found."""
        found, gray, cascade_pass = hit
        wider = _PROFILE_WIDER if cascade_pass.cascade == PROFILE else 1.0
        small, large = (wider * self.focal_px * mm / _depth(found) for mm in _REFINED_MM)
        x, y, w, h = found.box
        shift = _REFINED_SHIFT * w
        margin = round(large / 2 + shift)
        u, v = x + w / 2, y + h / 2
        height, width = (round(side * self.to_color) for side in gray.shape)
        left, top = max(round(u) - margin, 0), max(round(v) - margin, 0)
        roi = (left, top, min(round(u) + margin, width) - left,
               min(round(v) + margin, height) - top)
        again = cascade_pass._replace(face_px=np.inf, scale_step=_REFINED_STEP,
                                      min_neighbors=_REFINED_NEIGHBORS)
        center = CenterMask(np.ones((1, 1), np.bool_), 2 * shift / self.to_color,
                            (u - shift) / self.to_color, (v - shift) / self.to_color)
        return [candidate for candidate, _ in
                self._run(gray, roi, again, wider * w, (small, large), center)]

    def as_taken(self, _: Region) -> Bytes:
        """Give the image."""
        return self.gray

    def lifted(self, _: Region) -> Bytes:
        """Give the image with its shadows lifted: the square root of its brightness."""
        if self._lifted is None:
            self._lifted = lift_shadows(self.gray)
        return self._lifted

    def equalized(self, region: Region) -> Bytes | None:
        """Give the image with a dark region's contrast equalised by what lies at its depth."""
        key = (region.roi, region.near_mm, region.far_mm)
        if key not in self._equalized:
            x, y, w, h = roi = scaled(region.roi, 1 / self.to_color)
            rows, columns = np.ogrid[y:y + h:_SAMPLE_STEP, x:x + w:_SAMPLE_STEP]
            cell = self.gray.shape[1] / CELLS
            depth = self.cells.nearest[(rows / cell).astype(np.intp),
                                       (columns / cell).astype(np.intp)]
            at_depth = (depth >= region.near_mm) & (depth < region.far_mm)
            samples = self.gray[y:y + h:_SAMPLE_STEP, x:x + w:_SAMPLE_STEP][at_depth]
            dark = not len(samples) or np.median(samples) < _DARK
            self._equalized[key] = equalize_contrast(self.gray, roi, samples) if dark else None
        return self._equalized[key]

    def _run(
        self, gray: Bytes, roi: Box, cascade_pass: CascadePass, typical: float,
        sizes: tuple[float, float], centers: CenterMask,
    ) -> list[tuple[FaceCandidate, int]]:
        """Run a pass and judge its boxes, and give how many windows each stands for.

        roi, typical, sizes : pixels of `color`
        """
        shrink = 1 / self.to_color
        boxes = run_pass(gray, scaled(roi, shrink), cascade_pass, typical * shrink,
                         (sizes[0] * shrink, sizes[1] * shrink), centers)
        narrower = 1 / _PROFILE_WIDER if cascade_pass.cascade == PROFILE else 1.0
        return [(self._judge(resized(scaled(box, self.to_color), narrower)), windows)
                for box, windows in boxes]

    def _judge(self, box: Box) -> FaceCandidate:
        return judge_new(box, self.registered, self.focal_px, self.rejected)


def judge_new(
    box: Box, registered: Registration, focal_px: float, rejected: tuple[Box, ...]
) -> FaceCandidate:
    """Judge a box as `judge_box` does; what was rejected before stays so."""
    judged = judge_box(box, registered, focal_px)
    again = any(_same_thing(box, other) for other in rejected)
    return judged.model_copy(update={"verdict": REJECTED}) if again else judged


def detection_of(chosen: FaceCandidate, others: list[FaceCandidate]) -> Detection:
    """Give the result: the chosen face, and every other box that was judged."""
    candidates = (chosen.model_copy(update={"verdict": "chosen"}), *(
        c.model_copy(update={"verdict": "farther"}) if c.verdict == "face" else c
        for c in sorted(others, key=_depth)))
    return Detection(chosen.box, _depth(chosen), candidates)


def why_none(
    candidates: list[FaceCandidate], where: str
) -> NoFaceError | FaceWithoutDepthError:
    """Give the error of a frame without a face, with all that was judged."""
    error = _why_none(candidates, where)
    error.candidates = tuple(candidates)
    return error


def _why_none(
    candidates: list[FaceCandidate], where: str
) -> NoFaceError | FaceWithoutDepthError:
    if not candidates:
        return NoFaceError(f"no face found {where}")
    measured = [c for c in candidates if c.depth_mm is not None]
    if not measured:
        return FaceWithoutDepthError(
            f"face seen at {candidates[0].box}, but no depth was measured on it")
    box, width_mm, verdict = measured[-1].box, measured[-1].width_mm, measured[-1].verdict
    if verdict in (_FLAT, REJECTED):
        return NoFaceError(f"no face found: what the box at {box} shows is {verdict}")
    least, most = FACE_WIDTH_MM
    return NoFaceError(
        f"no face found: the box at {box} is {width_mm:.0f} mm wide at its depth, a face is "
        f"{least:.0f}-{most:.0f} mm")


def _same_thing(box: Box, rejected: Box) -> bool:
    (x, y, w, h), (left, top, width, height) = box, rejected
    return bool(max(abs(x + w / 2 - left - width / 2), abs(y + h / 2 - top - height / 2))
                < _REJECTED_WIDTHS * width)


def _depth(candidate: FaceCandidate) -> float:
    return np.inf if candidate.depth_mm is None else candidate.depth_mm
