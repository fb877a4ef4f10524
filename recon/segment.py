"""Stage 3: the depth of the face alone, from its box in the colour image.

What counts as face is forehead to chin and ear to ear. Ears, hair and neck of the same head may
stay where they touch it; walls, shoulders and other people may not.
"""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.errors import FaceWithoutDepthError
from recon.face import Box
from recon.masks import fill_holes
from recon.registration import Registration
from recon.seed_colors import seed_colors

__all__ = ["CLUSTERS", "Seeds", "cluster_depths", "crop_to_box", "keep_face", "segment_face",
           "window_of_box"]

CLUSTERS = 3
"""The paper's: face, body or hair, background."""

# About so many depths are enough to find the centres.
_CLUSTERED = 2000

# The cascades' box ends inside the forehead and near the chin, and sits aside of a turned face:
# how far a face reaches from its centre, in widths of the box.
_REACH_SIDE = 0.68
_REACH_UP = 0.74
_REACH_DOWN = 0.80
# A superellipse of this power, between an ellipse (2) and the box itself: a head is round, and
# the corners of its box hold shoulders.
_ROUNDNESS = 2.5
# How far behind its front a face reaches, in widths of the box, by how far below the centre: the
# ears at the top, the jaw, then the chin, behind which neck and chest begin.
_BELOW = (0.20, 0.35, 0.50, 0.60, 0.70, 0.75, 0.80)
_BEHIND = (0.95, 0.60, 0.48, 0.415, 0.30, 0.20, 0.0)
# The part of the box, each way from its centre, in which the front is sought.
_FRONT_PART = 0.3
# Two clusters are parts of one surface unless this much empty depth lies between them.
_GAP_MM = 60.0
# From pixel to pixel a face's surface steps less than this.
_STEP_MM = 12.0
# Unmeasured spots up to this many pixels across do not cut the surface in two.
_BRIDGE_PX = 5
# What is narrower than this is no part of a face but an ear, hair, or the frayed edge of depth.
_SPUR_MM = 30.0
# A part of the area, cut off from the largest, that is smaller than this share of it.
_ISLAND_SHARE = 0.15
# Around the box, what may hide a part of it and what smooths its outline.
_WINDOW_MARGIN_PX = 8
_SEED = 1


@dataclass(frozen=True, eq=False)
class Seeds:
    """The measured points of the face, in the order of the depth image's rows.

    Attributes
    ----------
    points : (n, 3) float32, mm, depth camera frame
    colors : (n, 3) uint8, RGB; the neighbours' mean where the colour camera does not see the
        point, and along the outline where the background mixes in
    pixels : (n, 2) int32, (row, column) in the depth image
    """

    points: NDArray[np.float32]
    colors: NDArray[np.uint8]
    pixels: NDArray[np.int32]


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
    corner = (registered.rows.start or 0, registered.columns.start or 0)
    return Seeds(registered.points[face], seed_colors(registered, face, _solid(face)),
                 (np.argwhere(face) + corner).astype(np.int32))


def window_of_box(registered: Registration, box: Box) -> tuple[slice, slice]:
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
    across, down = _in_box(registered, box)
    reach = np.where(down < 0, _REACH_UP, _REACH_DOWN)
    inside: NDArray[np.bool_] = registered.valid & (
        np.abs(across / _REACH_SIDE) ** _ROUNDNESS + np.abs(down / reach) ** _ROUNDNESS < 1)
    return inside


def cluster_depths(
    registered: Registration, crop: NDArray[np.bool_], box: Box
) -> NDArray[np.bool_]:
    """Cluster the cropped depths by k-means, Eq. (2), and keep the face's.

    Taken literally, k-means always makes three clusters, and where the crop holds nothing but
    the face it cuts the face itself. So clusters with no empty depth between them are joined
    before the one in the middle of the box is kept. Gives (H, W) bool.
    """
    z = np.ascontiguousarray(registered.points[..., 2][crop])
    if len(z) < CLUSTERS:
        return crop
    cv2.setRNGSeed(_SEED)  # k-means++ draws its first centres: same frame, same clusters
    _, _, centers = cv2.kmeans(
        z[::len(z) // _CLUSTERED + 1, None], CLUSTERS, np.empty(0, np.int32),
        (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.5), 3, cv2.KMEANS_PP_CENTERS)
    # In one dimension, the nearest centre is told by the middles between them.
    ordered = np.sort(np.asarray(centers, np.float32).ravel())
    labels = np.searchsorted((ordered[1:] + ordered[:-1]) / 2, z).astype(np.int32)
    label_image = np.full(crop.shape, -1, np.int32)
    label_image[crop] = labels
    middle = _nearest_pixel(registered, crop, box)
    kept = _joined(z, labels, int(label_image[middle]))
    return crop & np.isin(label_image, list(kept))


def keep_face(
    registered: Registration, cluster: NDArray[np.bool_], box: Box, focal_px: float
) -> NDArray[np.bool_]:
    """Keep what small steps connect with the middle of the box, as deep as a head, but no neck.

    Gives (H, W) bool.
    """
    start = _nearest_pixel(registered, cluster, box)
    depth, known = _bridged(registered.points[..., 2], cluster)
    blocked = np.zeros((depth.shape[0] + 2, depth.shape[1] + 2), np.uint8)
    blocked[1:-1, 1:-1] = ~known
    cv2.floodFill(depth, blocked, (int(start[1]), int(start[0])), 0.0,
                  _STEP_MM, _STEP_MM, 8 | cv2.FLOODFILL_MASK_ONLY | (2 << 8))
    face: NDArray[np.bool_] = cluster & (blocked[1:-1, 1:-1] == 2)
    across, down = _in_box(registered, box)
    z = registered.points[..., 2]
    middle = face & (np.abs(across) < _FRONT_PART) & (np.abs(down) < _FRONT_PART)
    front = float(np.percentile(z[middle if middle.any() else face], 2))
    box_mm = box[2] * front / focal_px
    face &= z < front + box_mm * np.interp(down, _BELOW, _BEHIND)
    return face & _smooth_outline(face, _SPUR_MM * registered.focal_px / front)


def _in_box(
    registered: Registration, box: Box
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Where each depth pixel is seen from the box's centre, rightward and down, in box widths."""
    x, y, width, height = box
    return ((registered.pixels[..., 0] - np.float32(x + width / 2)) / np.float32(width),
            (registered.pixels[..., 1] - np.float32(y + height / 2)) / np.float32(width))


def _nearest_pixel(
    registered: Registration, among: NDArray[np.bool_], box: Box
) -> tuple[int, int]:
    """The depth pixel of `among` that is seen nearest the middle of the box."""
    seen = among & registered.visible
    if not seen.any():
        raise FaceWithoutDepthError("no depth was measured where the colour camera sees the face")
    across, down = _in_box(registered, box)
    row, column = np.argwhere(seen)[np.argmin((across**2 + down**2)[seen])]
    return int(row), int(column)


def _joined(z: NDArray[np.float32], labels: NDArray[np.integer], kept: int) -> set[int]:
    """The clusters that hang together with `kept`, without an empty depth between."""
    spans = {label: np.percentile(z[labels == label], (2, 98)) for label in np.unique(labels)}
    together = {kept}
    for order in (sorted(spans, key=lambda k: spans[k][0]),
                  sorted(spans, key=lambda k: -spans[k][0])):
        for nearer, farther in pairwise(order):
            low, high = sorted((spans[nearer], spans[farther]), key=lambda s: float(s[0]))
            if nearer in together and low[1] + _GAP_MM > high[0]:
                together.add(farther)
    return together


def _bridged(
    z: NDArray[np.float32], known: NDArray[np.bool_]
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """Fill narrow gaps between known depths with their neighbours' mean."""
    kernel = (_BRIDGE_PX, _BRIDGE_PX)
    weight = cv2.boxFilter(known.astype(np.float32), -1, kernel, normalize=False)
    total = cv2.boxFilter(np.where(known, z, np.float32(0)), -1, kernel, normalize=False)
    near = weight > 0.5
    mean = np.divide(total, weight, out=np.zeros_like(total), where=near)
    # A depth that was measured and is not wanted is no gap: the flood shall not pass over it.
    return np.where(known, z, mean), known | (near & (z == 0))


def _smooth_outline(face: NDArray[np.bool_], spur_px: float) -> NDArray[np.bool_]:
    """The face's area without spurs and islands.

    At a depth edge the sensor sets pixels to either side; an island is an ear, or hair.
    """
    side = 2 * round(spur_px / 2) + 1
    opened = cv2.morphologyEx(
        _solid(face), cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)))
    _, parts = cv2.connectedComponents(opened, connectivity=4)
    areas = np.bincount(parts.ravel())[1:]
    kept = 1 + np.flatnonzero(areas >= _ISLAND_SHARE * areas.max(initial=0))
    return np.isin(parts, kept)


def _solid(face: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The face's area, (H, W) uint8, 0 or 1, its holes filled."""
    closed = cv2.morphologyEx(face.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return fill_holes(np.asarray(closed, np.uint8))
