"""Stage 3: the depth of the face alone, from its box in the colour image.

What counts as face is forehead to chin and ear to ear. Ears, hair and neck of the same head may
stay where they touch it; glasses, hands, walls, shoulders and other people may not.
"""

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.errors import FaceWithoutDepthError
from denseface.recon.face import Box, Seeds
from denseface.recon.intermediate import Registration
from denseface.recon.numerics.components import large_components
from denseface.recon.numerics.morphology import binary_fill_holes, opened
from denseface.recon.numerics.percentile import percentile
from denseface.recon.segmentation._depth_kmeans import split_depths
from denseface.recon.segmentation._edge_colors import seed_colors
from denseface.recon.segmentation._region_kernels import (
    nearest_pixel,
    principal_axis,
    priority_flood,
    row_medians,
    square_mask,
    superellipse_mask,
    trim_below_drop,
    trim_beside_rise,
    trim_to_profile,
)

__all__ = ["box_window", "cluster_depths", "crop_to_box", "keep_face", "segment_face"]

# The cascades' box ends inside the forehead and near the chin, and sits aside of a turned face:
# how far a face reaches from its centre, in widths of the box.
_REACH_SIDE = 0.68
_REACH_UP = 0.74
_REACH_DOWN = 0.80
# How far behind its front a face reaches, in widths of the box, by how far the centre lies toward
# the chin: the ears at the top, the jaw, then the chin, behind which neck and chest begin.
_BELOW = np.array([0.20, 0.35, 0.50, 0.60, 0.70, 0.75, 0.80])
_BEHIND = np.array([0.75, 0.60, 0.48, 0.415, 0.30, 0.20, 0.0])
# A box that is wider or narrower than this is larger or smaller than its face.
_BROADEST_MM = 165.0
_NARROWEST_MM = 130.0
# The part of the box, each way from its centre, in which the front is sought.
_FRONT_PART = 0.3
# Where depth falls by more than the first, over at most the second, farther down than the third, in
# widths of the box, the chin ends.
_CHIN_DROP_MM = 30.0
_CHIN_GAP_MM = 10.0
_CHIN = 0.3
# Farther aside than the first, in widths of the box, a face only recedes: what has come nearer by
# the second is another head, whose ear touches.
_SIDE = 0.35
_SIDE_RISE_MM = 12.0
# Of a face's front so much is longer than broad, and shows how the head is tipped.
_OVAL_MM = 30.0
# The part in which the slant of a lifted face is measured, and the most of it, mm a pixel.
_SLANT_PART = 0.4
_MOST_SLANT = 1.0
_SLANT_ROWS = 4
# Two clusters are parts of one surface unless this much empty depth lies between them.
_GAP_MM = 60.0
# From pixel to pixel a face's surface steps less than this, where pixels are coarse less than the
# second times their distance.
_STEP_MM = 10.0
_STEEPEST = 6.0
# A reading so much nearer than all ways to it is of another surface: outward a face only recedes,
# but for the nose, the lips and the chin.
_RISE_MM = 28.0
# The next reading may be so many pixels away, with unmeasured ones between.
_BRIDGE_PX = 5
# And so far where something stands before the face.
_COVERED_MM = 45.0
# A frame of glasses is narrower than the first, stands out by the second, is larger than the third,
# and goes on where it stands out by the last.
_WIRE_MM = 7.0
_WIRE_STEP_MM = 6.0
_WIRE_MM2 = 50.0
_WIRE_FAINT_MM = 4.0
# What stands before a face is broader than this and casts a shadow as wide as the second.
_FINGER_MM = 5.0
_SHADOW_MM = 8.0
# Bays of the outline that are narrower than this are unmeasured spots at its edge, unless they part
# an ear from it: farther sideways from the middle than the second, and less up or down.
_BAY_MM = 16.0
_EAR = 0.35
# What is narrower than this is no part of a face but an ear, hair, or the frayed edge of depth.
_SPUR_MM = 30.0
# A part of the area, cut off from the largest, that is smaller than this share of it.
_ISLAND_SHARE = 0.15
# Around the box, what may hide a part of it and what smooths its outline.
_WINDOW_MARGIN_PX = 8


def segment_face(registered: Registration, box: Box, focal_px: float) -> Seeds:
    """Cut the face's own points out of the depth image.

    Parameters
    ----------
    registered : the depth tied to the colour image
    box : x, y, width, height of the face; pixels of the colour image
    focal_px : focal length of the colour camera, pixels

    Raises
    ------
    FaceWithoutDepthError
        Where nothing was measured around the middle of the box.
    """
    crop = _measured_crop(registered, box)
    cluster = cluster_depths(registered, crop, box)
    face = keep_face(registered, cluster, box, focal_px)
    at = np.flatnonzero(face)
    row, column = np.divmod(at.astype(np.int32), np.int32(face.shape[1]))
    pixels = np.stack([row + np.int32(registered.rows.start or 0),
                       column + np.int32(registered.columns.start or 0)], axis=1)
    return Seeds(registered.points.reshape(-1, 3)[at],
                 seed_colors(registered, face, _solid(face)), pixels)


def box_window(registered: Registration, box: Box) -> tuple[slice, slice]:
    """Give the rows and columns of the depth image that hold all a face's box can show.

    Parameters
    ----------
    registered : every k-th pixel of the whole depth image
    box : x, y, width, height of the face; pixels of the colour image

    Raises
    ------
    FaceWithoutDepthError
        Where nothing was measured in the box.
    """
    crop = _measured_crop(registered, box)
    window = []
    for axis, part in ((1, registered.rows), (0, registered.columns)):
        step = part.step or 1
        inside = step * np.flatnonzero(crop.any(axis=axis))
        window.append(slice(max(int(inside[0]) - step - _WINDOW_MARGIN_PX, 0),
                            int(inside[-1]) + step + _WINDOW_MARGIN_PX + 1))
    return window[0], window[1]


def _measured_crop(registered: Registration, box: Box) -> NDArray[np.bool_]:
    crop = crop_to_box(registered, box)
    if not crop.any():
        raise FaceWithoutDepthError(f"no depth was measured in the face's box {box}")
    return crop


def crop_to_box(registered: Registration, box: Box) -> NDArray[np.bool_]:
    """Keep the depth pixels that project into the box, widened to what the face can reach.

    Gives (H, W) bool.
    """
    reach = box[2] * np.array((_REACH_SIDE, _REACH_UP, _REACH_DOWN))
    return superellipse_mask(registered.valid, registered.pixels, _middle(box),
                        reach.astype(np.float32))


def cluster_depths(
    registered: Registration, crop: NDArray[np.bool_], box: Box
) -> NDArray[np.bool_]:
    """Cluster the cropped depths by k-means, Eq. (2), and keep the face's.

    Taken literally, k-means always makes three clusters, and where the crop holds nothing but
    the face it cuts the face itself. So clusters with no empty depth between them are joined
    before the one in the middle of the box is kept. Gives (H, W) bool.
    """
    z = registered.points[..., 2]
    clusters = split_depths(z[crop])
    middle = round(float(z[_nearest_pixel(registered, crop, box)]))
    first = last = sum(cluster.last < middle for cluster in clusters)
    while first > 0 and clusters[first].low - clusters[first - 1].high < _GAP_MM:
        first -= 1
    while last + 1 < len(clusters) and clusters[last + 1].low - clusters[last].high < _GAP_MM:
        last += 1
    return crop & (z > clusters[first].first - 1) & (z < clusters[last].last + 1)


def keep_face(
    registered: Registration, cluster: NDArray[np.bool_], box: Box, focal_px: float
) -> NDArray[np.bool_]:
    """Keep what small steps connect with the middle of the box, as deep as a head, but no neck.

    Gives (H, W) bool.
    """
    z = np.ascontiguousarray(registered.points[..., 2])
    px = registered.focal_px / float(z[_nearest_pixel(registered, cluster, box)])  # for each mm
    cover = _frames_of_glasses(z, cluster, px)
    wanted = cluster & ~cover
    start = _nearest_pixel(registered, wanted, box)
    middle, width = _middle(box), box[2]
    upright = _upright(z, square_mask(wanted, registered.pixels, middle, _SLANT_PART * width))
    face = _connected(upright, wanted, cover, start, px)
    hand = _before(z, registered.valid, face, px)
    if hand.any():
        cover |= hand
        face = _connected(upright, wanted, cover, start, px)
    inner = square_mask(face, registered.pixels, middle, _FRONT_PART * width)
    inner = inner if inner.any() else face
    front = percentile(z[inner], 2)
    box_mm = width * front / focal_px
    trim_beside_rise(face, z, *start, round(_SIDE * box_mm * px), _SIDE_RISE_MM)
    axis = principal_axis(face & (upright < percentile(upright[inner], 2) + np.float32(_OVAL_MM)))
    trim_below_drop(face, z, *start, round(_CHIN * box_mm * px), _CHIN_DROP_MM,
              max(round(_CHIN_GAP_MM * px), _BRIDGE_PX))
    trim_to_profile(face, z, registered.pixels, front, middle, axis, width * _BELOW,
              min(max(box_mm, _NARROWEST_MM), _BROADEST_MM) * _BEHIND)
    return face & _smooth_outline(
        face | cover, registered.valid & ~face, start, _EAR * box_mm * px, px)


def _upright(z: NDArray[np.float32], middle: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The depths without the slant of a face that is lifted or lowered; 0 stays 0."""
    rows, medians = row_medians(z, middle, _SLANT_ROWS)
    if len(rows) < 2:
        return z
    # Of the rows' medians, the median slope between their upper and their lower half: a hand
    # before the chin does not tilt it.
    half = len(rows) // 2
    slant = percentile(
        (medians[half:2 * half] - medians[:half]) / (rows[half:2 * half] - rows[:half]), 50)
    tilt = (np.arange(len(z)) - rows[0]) * min(max(slant, -_MOST_SLANT), _MOST_SLANT)
    return np.where(z > 0, z - tilt[:, None].astype(np.float32), np.float32(0))


def _connected(
    z: NDArray[np.float32], wanted: NDArray[np.bool_], cover: NDArray[np.bool_],
    start: tuple[int, int], px: float,
) -> NDArray[np.bool_]:
    return priority_flood(z, wanted, cover, *start, max(_STEP_MM, _STEEPEST / px), _RISE_MM,
                          _BRIDGE_PX, max(round(_COVERED_MM * px), _BRIDGE_PX))


def _frames_of_glasses(
    z: NDArray[np.float32], cluster: NDArray[np.bool_], px: float
) -> NDArray[np.bool_]:
    """What stands before the surface, is narrow and long; `px` pixels are a millimetre."""
    kernel = np.ones((2 * round(_WIRE_MM * px / 2) + 1,) * 2, np.uint8)
    behind = cv2.dilate(np.where(cluster, z, np.float32(0)), kernel)
    behind = cv2.erode(np.where(behind > 0, behind, np.float32(np.inf)), kernel)
    wires = large_components(cluster & (behind - z > _WIRE_STEP_MM), _WIRE_MM2 * px * px)
    if not wires.any():
        return wires
    faint = cluster & (behind - z > _WIRE_FAINT_MM)
    _, parts = cv2.connectedComponents(faint.view(np.uint8), connectivity=8)
    return np.isin(parts, np.unique(parts[wires]))


def _before(
    z: NDArray[np.float32], valid: NDArray[np.bool_], face: NDArray[np.bool_], px: float
) -> NDArray[np.bool_]:
    """A hand, or what else stands before the face, and its shadow in which nothing is measured."""
    nearer = (valid & ~face & (z < percentile(z[face], 50))).view(np.uint8)
    side = 2 * round(_FINGER_MM * px / 2) + 1
    hand = cv2.morphologyEx(nearer, cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    side = 2 * round(_SHADOW_MM * px) + 1
    around = cv2.dilate(hand, np.ones((side, side), np.uint8)) > 0
    return around & ~face & ((hand > 0) | ~valid)


def _middle(box: Box) -> tuple[float, float]:
    x, y, width, height = box
    return x + width / 2, y + height / 2


def _nearest_pixel(
    registered: Registration, among: NDArray[np.bool_], box: Box
) -> tuple[int, int]:
    """The depth pixel of `among` that is seen nearest the middle of the box."""
    row, column = nearest_pixel(among, registered.visible, registered.pixels, _middle(box))
    if row < 0:
        raise FaceWithoutDepthError("no depth was measured where the colour camera sees the face")
    return row, column


def _smooth_outline(
    face: NDArray[np.bool_], other: NDArray[np.bool_], middle: tuple[int, int], ear_px: float,
    px: float,
) -> NDArray[np.bool_]:
    """The face's area without spurs and islands; `px` pixels are a millimetre.

    At a depth edge the sensor sets pixels to either side; an island is an ear, or hair.
    """
    side = 2 * round(_BAY_MM * px / 2) + 1
    closed = cv2.morphologyEx(
        face.view(np.uint8), cv2.MORPH_CLOSE, np.ones((side, side), np.uint8)).view(bool)
    top, left, bottom, right = (max(round(place + way), 0) for way in (-ear_px, ear_px)
                                for place in middle)
    closed[top:bottom, :left] = closed[top:bottom, right:] = False
    area = _solid(face | (closed & ~other))
    # Half the pixels each way: so much detail is enough, in a fourth of the time.
    half = np.asarray(
        cv2.dilate(area, np.ones((2, 2), np.uint8), anchor=(0, 0))[::2, ::2], np.uint8, order="C")
    _, parts = cv2.connectedComponents(opened(half, _SPUR_MM * px / 4), connectivity=4)
    areas = np.bincount(parts.ravel())
    areas[0] = 0
    kept = ((areas > 0) & (areas >= _ISLAND_SHARE * areas.max()))[parts]
    return np.asarray(kept.repeat(2, axis=0).repeat(2, axis=1)[:face.shape[0], :face.shape[1]])


def _solid(face: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The face's area, (H, W) uint8, 0 or 1, its holes filled."""
    closed = cv2.morphologyEx(face.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return binary_fill_holes(np.asarray(closed, np.uint8))
