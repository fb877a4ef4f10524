"""The region of a face in the depth image, from its box in the colour image.

What counts as face is forehead to chin and ear to ear. Ears, hair and neck of the same head may
stay where they touch it; glasses, hands, walls, shoulders and other people may not
(docs/decisions/0003-what-counts-as-face.md).
"""

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats
from denseface.recon.errors import FaceWithoutDepthError
from denseface.recon.face import Box, Seeds
from denseface.recon.intermediate import Registration
from denseface.recon.numerics.morphology import large_components, select_values
from denseface.recon.numerics.percentile import percentile
from denseface.recon.segmentation._depth_kmeans import split_depths
from denseface.recon.segmentation._edge_colors import seed_colors
from denseface.recon.segmentation._outline import smooth_outline, solid
from denseface.recon.segmentation._region_kernels import (
    FloodLimits,
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

_SEMI_AXES = np.array((0.68, 0.74, 0.80))
"""How far a face reaches sideward, up and down from the centre of its box, box widths.

The cascades' box ends inside the forehead and near the chin, and sits aside of a turned face.
"""
_WINDOW_MARGIN_PX = 8
"""Pixels around the box's own for what may hide a part of it and what smooths its outline."""

_PROFILE_BELOW = np.array([0.20, 0.35, 0.50, 0.60, 0.70, 0.75, 0.80])
"""Distances from the box's centre toward the chin, box widths."""
_PROFILE_BEHIND = np.array([0.75, 0.60, 0.48, 0.415, 0.30, 0.20, 0.0])
"""How far behind its front a face reaches there, box widths: ears, jaw, then the chin, behind
which neck and chest begin."""
_BOX_MM = (130.0, 165.0)
"""Narrowest and widest face; a box outside of that is smaller or larger than its face."""
_FRONT_PART = 0.3
"""Where the front is sought, each way from the box's centre, box widths."""
_OVAL_MM = 30.0
"""Depth of a face's front that is longer than broad, and so shows how the head is tipped."""

_CHIN_DROP_MM = 30.0
"""Growth of depth at the end of the chin, within `_CHIN_GAP_MM`."""
_CHIN_GAP_MM = 10.0
_CHIN = 0.3
"""No chin ends nearer to the centre of the box, box widths."""
_SIDE = 0.35
"""Farther aside from the centre than this, box widths, a face only recedes."""
_SIDE_RISE_MM = 12.0
"""What comes nearer again by this is another head, whose ear touches."""

_SLANT_PART = 0.4
"""Where the slant of a lifted or lowered face is measured, each way from the centre, box widths."""
_MOST_SLANT = 1.0
"""Largest slant that is taken off, mm a pixel."""
_SLANT_ROWS = 4
"""Every so many rows are enough to measure it."""

_CLUSTER_GAP_MM = 60.0
"""Empty depth between clusters of different surfaces."""
_STEP_MM = 10.0
"""Largest step in depth from pixel to pixel of a face."""
_STEEPEST = 6.0
"""The same where pixels are coarse, as a slope."""
_RISE_MM = 28.0
"""A reading so much nearer than all ways to it is of another surface: outward a face only recedes,
but for the nose, the lips and the chin."""
_GAP_PX = 5
"""Largest distance from reading to reading of a surface, over unmeasured pixels."""
_OCCLUDED_MM = 45.0
"""The same behind what stands before the face."""

_WIRE_MM = 7.0
"""Widest wire of a frame of glasses."""
_WIRE_STEP_MM = 6.0
"""How far a wire stands out from the face."""
_WIRE_FAINT_MM = 4.0
"""How far it does where it goes on from there."""
_WIRE_MM2 = 50.0
"""Smallest area of a wire."""
_FINGER_MM = 5.0
"""What stands before a face is broader than this."""
_SHADOW_MM = 8.0
"""Width of the unmeasured shadow that it casts on the face."""

_EAR = 0.35
"""Bays farther sideways from the centre than this, and less up or down, box widths, stay open:
they part an ear from the face."""


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
    face = grow_face(registered, cluster, box, focal_px)
    at = np.flatnonzero(face)
    row, column = np.divmod(at.astype(np.int32), np.int32(face.shape[1]))
    pixels = np.stack([row + np.int32(registered.rows.start or 0),
                       column + np.int32(registered.columns.start or 0)], axis=1)
    return Seeds(registered.points.reshape(-1, 3)[at],
                 seed_colors(registered, face, solid(face)), pixels)


def box_window(registered: Registration, box: Box, side: int = 1) -> tuple[slice, slice]:
    """Give the rows and columns of the depth image that hold all a face's box can show.

    Parameters
    ----------
    registered : every k-th pixel of the whole depth image
    box : x, y, width, height of the face; pixels of the colour image
    side : pixels of the depth that will be one, each way

    Raises
    ------
    FaceWithoutDepthError
        Where nothing was measured in the box.
    """
    margin = _WINDOW_MARGIN_PX * side
    crop = _measured_crop(registered, box)
    window = []
    for axis, part in ((1, registered.rows), (0, registered.columns)):
        step = part.step or 1
        inside = step * np.flatnonzero(crop.any(axis=axis))
        window.append(slice(max(int(inside[0]) - step - margin, 0),
                            int(inside[-1]) + step + margin + 1))
    return window[0], window[1]


def _measured_crop(registered: Registration, box: Box) -> Bools:
    crop = crop_to_box(registered, box)
    if not crop.any():
        raise FaceWithoutDepthError(f"no depth was measured in the face's box {box}")
    return crop


def crop_to_box(registered: Registration, box: Box) -> Bools:
    """Keep the measured pixels seen in the box, widened to what the face can reach, (H, W)."""
    return superellipse_mask(registered.valid, registered.pixels, _center(box),
                             (box[2] * _SEMI_AXES).astype(np.float32))


def cluster_depths(registered: Registration, crop: Bools, box: Box) -> Bools:
    """Cluster the cropped depths by k-means, Eq. (2), and keep the face's, (H, W).

    Taken literally, k-means always makes three clusters, and where the crop holds nothing but
    the face it cuts the face itself. So clusters with no empty depth between them are joined
    before the one in the middle of the box is kept.
    """
    z = np.ascontiguousarray(registered.points[..., 2])
    clusters = split_depths(select_values(z, crop))
    middle = round(float(z[_central_pixel(registered, crop, box)]))
    first = last = sum(cluster.last < middle for cluster in clusters)
    while first > 0 and clusters[first].low - clusters[first - 1].high < _CLUSTER_GAP_MM:
        first -= 1
    while (last + 1 < len(clusters)
           and clusters[last + 1].low - clusters[last].high < _CLUSTER_GAP_MM):
        last += 1
    return crop & (z > clusters[first].first - 1) & (z < clusters[last].last + 1)


def grow_face(registered: Registration, cluster: Bools, box: Box, focal_px: float) -> Bools:
    """Keep what small steps connect with the middle of the box, as deep as a head, but no neck.

    cluster : (H, W); focal_px : of the colour camera, pixels

    Returns (H, W).
    """
    z = np.ascontiguousarray(registered.points[..., 2])
    px_per_mm = registered.focal_px / float(z[_central_pixel(registered, cluster, box)])
    occluders = _glasses(z, cluster, px_per_mm)
    candidates = cluster & ~occluders
    start = _central_pixel(registered, candidates, box)
    center, width = _center(box), box[2]
    upright = _without_slant(
        z, square_mask(candidates, registered.pixels, center, _SLANT_PART * width))
    limits = FloodLimits(max(_STEP_MM, _STEEPEST / px_per_mm), _RISE_MM, _GAP_PX,
                         max(round(_OCCLUDED_MM * px_per_mm), _GAP_PX))
    face = priority_flood(upright, candidates, occluders, start, limits)
    hand = _hand(z, registered.valid, face, px_per_mm)
    if hand.any():
        occluders |= hand
        face = priority_flood(upright, candidates, occluders, start, limits)
    inner = square_mask(face, registered.pixels, center, _FRONT_PART * width)
    inner = inner if inner.any() else face
    front = percentile(select_values(z, inner), 2)
    box_mm = width * front / focal_px
    trim_beside_rise(face, z, start, round(_SIDE * box_mm * px_per_mm), _SIDE_RISE_MM)
    axis = principal_axis(face & (upright < percentile(select_values(upright, inner), 2)
                                     + np.float32(_OVAL_MM)))
    trim_below_drop(face, z, start, round(_CHIN * box_mm * px_per_mm), _CHIN_DROP_MM,
                    max(round(_CHIN_GAP_MM * px_per_mm), _GAP_PX))
    trim_to_profile(
        face, z, registered.pixels, front, center, axis,
        (width * _PROFILE_BELOW, min(max(box_mm, _BOX_MM[0]), _BOX_MM[1]) * _PROFILE_BEHIND))
    return face & smooth_outline(face | occluders, registered.valid & ~face, start,
                                  _EAR * box_mm * px_per_mm, px_per_mm)


def _without_slant(z: Floats, middle: Bools) -> Floats:
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


def _glasses(z: Floats, cluster: Bools, px_per_mm: float) -> Bools:
    """Frames of glasses: what stands before the surface, is narrow and long."""
    kernel = np.ones((2 * round(_WIRE_MM * px_per_mm / 2) + 1,) * 2, np.uint8)
    behind = cv2.dilate(np.where(cluster, z, np.float32(0)), kernel)
    behind = cv2.erode(np.where(behind > 0, behind, np.float32(np.inf)), kernel)
    wires = large_components(
        cluster & (behind - z > _WIRE_STEP_MM), _WIRE_MM2 * px_per_mm * px_per_mm)
    if not wires.any():
        return wires
    faint = cluster & (behind - z > _WIRE_FAINT_MM)
    _, parts = cv2.connectedComponents(faint.view(np.uint8), connectivity=8)
    return np.isin(parts, np.unique(parts[wires]))


def _hand(z: Floats, valid: Bools, face: Bools, px_per_mm: float) -> Bools:
    """A hand, or what else stands before the face, and its shadow in which nothing is measured."""
    nearer = (valid & ~face & (z < percentile(select_values(z, face), 50))).view(np.uint8)
    side = 2 * round(_FINGER_MM * px_per_mm / 2) + 1
    hand = cv2.morphologyEx(nearer, cv2.MORPH_OPEN, np.ones((side, side), np.uint8))
    side = 2 * round(_SHADOW_MM * px_per_mm) + 1
    around = cv2.dilate(hand, np.ones((side, side), np.uint8)) > 0
    return around & ~face & ((hand > 0) | ~valid)


def _center(box: Box) -> tuple[float, float]:
    x, y, width, height = box
    return x + width / 2, y + height / 2


def _central_pixel(registered: Registration, mask: Bools, box: Box) -> tuple[int, int]:
    """The depth pixel of a mask that is seen nearest the middle of the box."""
    row, column = nearest_pixel(mask, registered.visible, registered.pixels, _center(box))
    if row < 0:
        raise FaceWithoutDepthError("no depth was measured where the colour camera sees the face")
    return row, column
