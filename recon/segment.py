"""Stage 3: the depth of the face alone, from its box in the colour image.

What counts as face is forehead to chin and ear to ear. Ears, hair and neck of the same head may
stay where they touch it; walls, shoulders and other people may not.
"""

from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from recon.colors import average_neighbors
from recon.errors import FaceWithoutDepthError
from recon.registration import Registration

__all__ = ["CLUSTERS", "Seeds", "cluster_depths", "crop_to_box", "keep_face", "segment_face"]

CLUSTERS = 3
"""The paper's: face, body or hair, background."""

# The cascades' box ends inside the forehead and near the chin and may sit half a cheek aside: the
# crop is its centre and what a head can reach from there, in millimetres.
_REACH_SIDE_MM = 100.0
_REACH_UP_MM = 125.0
_REACH_DOWN_MM = 125.0
# Two clusters are parts of one surface unless this much empty depth lies between them.
_GAP_MM = 60.0
# From pixel to pixel a face's surface steps less than this.
_STEP_MM = 12.0
# Ear to nose tip, with room for the largest head.
_HEAD_DEPTH_MM = 150.0
# Unmeasured spots up to this many pixels across do not cut the surface in two.
_BRIDGE_PX = 5
_SEED = 1


@dataclass(frozen=True, eq=False)
class Seeds:
    """The measured points of the face, in the order of the depth image's rows.

    Attributes
    ----------
    points : (n, 3) float32, mm, depth camera frame
    colors : (n, 3) uint8, RGB; the neighbours' mean where the colour camera does not see the
        point, and along the outline, where the background mixes in
    pixels : (n, 2) int32, (row, column) in the depth image
    """

    points: NDArray[np.float32]
    colors: NDArray[np.uint8]
    pixels: NDArray[np.int32]


def segment_face(
    registered: Registration, box: tuple[int, int, int, int], depth_mm: float, focal_px: float
) -> Seeds:
    """Cut the face's own points out of the depth image.

    Parameters
    ----------
    registered : the depth tied to the colour image
    box : x, y, width, height of the face; pixels of the colour image
    depth_mm : the face's depth, in the colour camera's frame
    focal_px : focal length of the colour camera, pixels

    Raises
    ------
    FaceWithoutDepthError
        Where nothing was measured around the middle of the box.
    """
    center = (box[0] + box[2] / 2, box[1] + box[3] / 2)
    crop = crop_to_box(registered, center, depth_mm, focal_px)
    if not crop.any():
        raise FaceWithoutDepthError(f"no depth was measured in the face's box {box}")
    cluster = cluster_depths(registered, crop, center)
    face = keep_face(registered, cluster, center)
    return Seeds(registered.points[face], _colors(registered, face),
                 np.argwhere(face).astype(np.int32))


def crop_to_box(
    registered: Registration, center: tuple[float, float], depth_mm: float, focal_px: float
) -> NDArray[np.bool_]:
    """Keep the depth pixels that project into the box, widened to what a head can reach.

    The crop is an ellipse about the box's centre: a head is round, and the corners of its box
    hold shoulders. Gives (H, W) bool.
    """
    pixel_mm = depth_mm / focal_px
    across = (registered.pixels[..., 0] - center[0]) * pixel_mm / _REACH_SIDE_MM
    down = (registered.pixels[..., 1] - center[1]) * pixel_mm
    down = down / np.where(down < 0, _REACH_UP_MM, _REACH_DOWN_MM)
    inside: NDArray[np.bool_] = registered.valid & (across * across + down * down < 1)
    return inside


def cluster_depths(
    registered: Registration, crop: NDArray[np.bool_], center: tuple[float, float]
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
    _, labels, _ = cv2.kmeans(
        z[:, None], CLUSTERS, np.empty(0, np.int32),
        (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.5), 3, cv2.KMEANS_PP_CENTERS)
    label_image = np.full(crop.shape, -1, np.int32)
    labels = np.asarray(labels, np.int32).ravel()
    label_image[crop] = labels
    middle = _nearest_pixel(registered, crop, center)
    kept = _joined(z, labels, int(label_image[middle]))
    return crop & np.isin(label_image, list(kept))


def keep_face(
    registered: Registration, cluster: NDArray[np.bool_], center: tuple[float, float]
) -> NDArray[np.bool_]:
    """Keep what is connected with the middle of the box by small steps, and no deeper than a head.

    Gives (H, W) bool.
    """
    start = _nearest_pixel(registered, cluster, center)
    depth, known = _bridged(registered.points[..., 2], cluster)
    blocked = np.zeros((depth.shape[0] + 2, depth.shape[1] + 2), np.uint8)
    blocked[1:-1, 1:-1] = ~known
    cv2.floodFill(depth, blocked, (int(start[1]), int(start[0])), 0.0,
                  _STEP_MM, _STEP_MM, 8 | cv2.FLOODFILL_MASK_ONLY | (2 << 8))
    face: NDArray[np.bool_] = cluster & (blocked[1:-1, 1:-1] == 2)
    z = registered.points[..., 2]
    front = np.percentile(z[face], 2)
    face &= z < front + _HEAD_DEPTH_MM
    # A pixel with hardly a neighbour is an edge's flying pixel.
    neighbours = cv2.filter2D(face.astype(np.uint8), -1, np.ones((3, 3), np.uint8),
                              borderType=cv2.BORDER_CONSTANT)
    return face & (neighbours >= 4)


def _nearest_pixel(
    registered: Registration, among: NDArray[np.bool_], center: tuple[float, float]
) -> tuple[int, int]:
    """The depth pixel of `among` that is seen nearest the given place of the colour image."""
    seen = among & registered.visible
    if not seen.any():
        raise FaceWithoutDepthError("no depth was measured where the colour camera sees the face")
    at = np.argwhere(seen)
    gap = registered.pixels[seen] - np.array(center, np.float32)
    row, column = at[np.argmin((gap * gap).sum(axis=1))]
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
    return np.where(known, z, mean), known | near


def _colors(registered: Registration, face: NDArray[np.bool_]) -> NDArray[np.uint8]:
    """The seeds' colours, (n, 3) uint8; where not to be trusted, their neighbours'."""
    seen = face & registered.visible
    inner = _away_from_outline(face) & seen
    trusted = inner if inner.any() else seen
    if not trusted.any():
        return np.zeros((int(face.sum()), 3), np.uint8)
    averaged = average_neighbors(registered.colors[trusted], np.argwhere(trusted), face.shape, 1, 1)
    return np.where(trusted[face][:, None], registered.colors[face], averaged[face])


def _away_from_outline(face: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The face without its outermost pixels; holes inside it have no outline."""
    solid = cv2.morphologyEx(face.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((9, 9), np.uint8))
    outside = solid == 0
    count, parts = cv2.connectedComponents(outside.astype(np.uint8), connectivity=4)
    if count > 1:
        border = np.unique(np.concatenate([parts[0], parts[-1], parts[:, 0], parts[:, -1]]))
        outside &= np.isin(parts, border)
    inner = cv2.erode((~outside).astype(np.uint8), np.ones((5, 5), np.uint8),
                      borderType=cv2.BORDER_CONSTANT, borderValue=1)
    return face & (inner > 0)
