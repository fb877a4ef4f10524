"""The whole measurement of a frame on one page."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from denseface.capture.frame import RgbdFrame
from denseface.recon.detection import close_face, follow_face, look_for_faces
from denseface.recon.errors import NoDepthError, NoFaceError
from denseface.recon.face import FaceCandidate
from denseface.recon.intermediate import Registration
from denseface.recon.quality._head import heads_by_depth
from denseface.recon.quality._light import light, sharpness
from denseface.recon.quality._motion import Patch, motion_mm
from denseface.recon.quality._pose import pose
from denseface.recon.quality._presence import FARTHEST_MM, SPARSE, SparseDepth
from denseface.recon.quality._quality import FaceQuality, Memory, Quality, Sight
from denseface.recon.registration import register, with_shaded_depth

_SEARCH_EVERY = 5
"""While a face is followed, every so many measurements the whole image is searched for others."""
_MISSES = 10
"""After so many measurements in which colour did not show the followed face, it is given up."""
_STILL = 30
"""What is near, shows no face and did not move for so many measurements is furniture."""
_LOOK_AGAIN = 9
"""Furniture is searched every so many measurements, by each pass in turn."""
_NEARER_MM = 30.0
"""A face that is nearer than the followed one by more is followed instead."""
_SAME_BOX = 0.5
"""Boxes whose middles are nearer than this, by the width of one, are of one face."""
_RECENT_BEST = 0.99
"""What is left of the best sharpness after each measurement: half after seven seconds."""
_RECENT_US = 2_000_000
"""Between two measurements; after longer the face may be somebody else's, who is sharp in another
way: a beard has twice the gradient of a cheek."""
_NO_DEPTH_SHARE = 0.35
"""Of the middle of the depth image: with more of it unmeasured, something may be too near."""


def measure(
    frame: RgbdFrame, previous: Quality | None = None, at_us: int | None = None
) -> Quality:
    """Measure a frame.

    Depth decides first whether anybody is there; only then is a face looked for, at first where it
    was in the frame before.

    Parameters
    ----------
    frame : the frame; `color` may be None
    previous : the measurement of an earlier frame of the same stream. Without it nothing is known
        of motion, and sharpness is 1.
    at_us : when it was exposed, by any clock, microseconds; by the depth's stamp where None, which
        some sensors do not give
    """
    memory = previous.memory if previous else Memory()
    memory = replace(memory, count=memory.count + 1)
    depth = SparseDepth.of(frame)
    too_near = _too_near(frame, depth)
    if not depth.somebody:
        return Quality(frame.depth_timestamp_us, too_near, too_near,
                       memory=Memory(count=memory.count))
    still = memory.still + 1 if memory.vain and depth.same_as(memory.vain) else 0
    if still > _STILL and memory.count % _LOOK_AGAIN:
        return _without_face(frame, depth, memory, still, somebody=too_near, too_near=too_near)
    colored = frame.color is not None
    frame = with_shaded_depth(frame)
    found = _find(frame, memory)
    if found.face is None or (found.sight is Sight.DEPTH and still > _STILL):
        somebody = too_near or (found.possible and still <= _STILL)
        return _without_face(frame, depth, memory, still, somebody=somebody, too_near=too_near)
    exposed_us = frame.depth_timestamp_us if at_us is None else at_us
    quality = _of_face(frame, found, found.face, memory, exposed_us, too_near=too_near,
                       colored=colored)
    if found.sight is not Sight.DEPTH:
        return quality
    return replace(quality, memory=replace(
        quality.memory, still=still, vain=memory.vain if still else depth))


def _without_face(
    frame: RgbdFrame, depth: SparseDepth, memory: Memory, still: int, *, somebody: bool,
    too_near: bool,
) -> Quality:
    """Give the quality of a frame that shows no face; and note what was searched in vain."""
    return Quality(frame.depth_timestamp_us, somebody, too_near, memory=Memory(
        count=memory.count, still=still, vain=memory.vain if still else depth))


class _Found(NamedTuple):
    face: FaceCandidate | None
    sight: Sight
    others: int
    possible: bool
    """Whether depth has any place for a face."""


def _too_near(frame: RgbdFrame, depth: SparseDepth) -> bool:
    """Look for a face without depth, where much of the middle of the image has none."""
    rows, columns = depth.counts.shape
    middle = depth.counts[rows // 4:-(rows // 4) or None, columns // 4:-(columns // 4) or None]
    if frame.color is None or not middle.size or np.mean(middle == 0) < _NO_DEPTH_SHARE:
        return False
    return close_face(frame.color)


def _find(frame: RgbdFrame, memory: Memory) -> _Found:
    """Find the nearest face, or nothing where none could be seen at all."""
    sparse = slice(None, None, SPARSE)
    try:
        return _find_in(frame, register(frame, sparse, sparse, colors=False), memory)
    except (NoDepthError, NoFaceError):  # nothing before the colour camera; a strip of an image
        return _Found(None, Sight.DEPTH, 0, False)


def _find_in(frame: RgbdFrame, overview: Registration, memory: Memory) -> _Found:
    """Find the nearest face: near the last one, in the whole image, or by its depth."""
    color, focal_px = frame.rgb, frame.calibration.color.fx
    face: FaceCandidate | None = None
    others, possible, frontal = memory.others, True, True
    if memory.followed is not None:
        again = follow_face(color, overview, focal_px, memory.followed, memory.count)
        if again is not None:
            face, frontal = again
    if face is None or memory.count % _SEARCH_EVERY == 0:
        turn = memory.count if face is None else 0
        looked = look_for_faces(color, overview, focal_px, turn, FARTHEST_MM)
        possible = looked.searched or face is not None
        faces = [other for other in looked.faces if face is None or _apart(face, other)]
        if faces and (face is None or _depth(faces[0]) < _depth(face) - _NEARER_MM):
            faces = [face, *faces[1:]] if face is not None else faces[1:]
            face, frontal = looked.faces[0], looked.frontal
        others = len(faces) if face is not None else 0
    if face is not None:
        return _Found(face, Sight.AHEAD if frontal else Sight.ASIDE, others, True)
    if not possible:
        return _Found(None, Sight.DEPTH, 0, False)
    heads = heads_by_depth(overview, focal_px, FARTHEST_MM)
    return _Found(heads[0] if heads else None, Sight.DEPTH, 0, True)


def _of_face(
    frame: RgbdFrame, found: _Found, chosen: FaceCandidate, memory: Memory, exposed_us: int, *,
    too_near: bool, colored: bool,
) -> Quality:
    """Measure the face itself."""
    box, distance = chosen.box, _depth(chosen)
    x, y, w, h = box
    image = frame.calibration.color
    patch = Patch.of(frame, box, distance, exposed_us, shaded=not colored)
    motion = None if patch is None else motion_mm(frame, patch, memory.patch)
    sharp = None if patch is None or not colored else sharpness(patch.image)
    recent = patch is None or memory.patch is None or (
        exposed_us - memory.patch.exposed_us <= _RECENT_US)
    best = max(sharp or 0.0, memory.best_sharpness * _RECENT_BEST if recent else 0.0)
    lit = light(frame.rgb, box) if colored else None
    looks = pose(frame, box, distance)
    missed = memory.missed + 1 if found.sight is Sight.DEPTH else 0
    face = FaceQuality(
        box=box, sight=found.sight, distance_mm=distance,
        off_center=((x + w / 2) / image.width - 0.5, (y + h / 2) / image.height - 0.5),
        coverage=looks.coverage, turn_deg=looks.turn_deg, tilt_deg=looks.tilt_deg,
        motion_mm=motion, sharpness=None if sharp is None else sharp / max(best, 1e-9),
        dark=lit and lit.dark, burnt=lit and lit.burnt)
    return Quality(frame.depth_timestamp_us, True, too_near, 1 + found.others, face, Memory(
        count=memory.count, followed=chosen if missed <= _MISSES else None, missed=missed,
        others=found.others, patch=patch, best_sharpness=best))


def _depth(face: FaceCandidate) -> float:
    return np.inf if face.depth_mm is None else face.depth_mm


def _apart(a: FaceCandidate, b: FaceCandidate) -> bool:
    """Whether two boxes are of two faces."""
    (ax, ay, aw, ah), (bx, by, bw, bh) = a.box, b.box
    off = np.hypot(ax + aw / 2 - bx - bw / 2, ay + ah / 2 - by - bh / 2)
    return bool(off > _SAME_BOX * max(aw, bw))
