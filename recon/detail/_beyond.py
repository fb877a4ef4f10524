"""Past the outline: where the sensor read nothing, and faces go on.

A face is not seen to its end: the sensor's pattern does not come back from steep sides, from under
the chin, nor from the shadow of a nose or of glasses, and the outline has bays there. A few
millimetres out of what was measured a face of the model (`recon.prior`) that is fitted to the rest
tells more than the surface's own slopes: drawn there and moved by what it is off nearby, it is the
mean of a process of which the residual is averaged (kriging with a known trend). Where a reading
says that something else is there, nothing is added. Constants: docs/decisions/0056.
"""

from dataclasses import replace

import cv2
import numpy as np

from denseface.recon.arrays import Bools, Floats, Ints
from denseface.recon.intermediate import DepthReader, SurfaceGrid
from denseface.recon.numerics.filters import blurred, downsampled
from denseface.recon.numerics.morphology import binary_fill_holes, disc
from denseface.recon.numerics.percentile import percentile
from denseface.recon.numerics.scatter import interpolate
from denseface.recon.prior import HeadPose, Heights, fit_face

__all__ = ["beyond_outline"]

_REACH_MM = 5.0
"""How far past the outline the face goes on, mm."""
_STEEPEST = 4.0
"""Slope of the model from which on it is its silhouette."""
_MOST_OFF_MM = 1.5
"""A surface of which half is farther off all faces is none that this tells of, mm."""
_NEAR_MM, _FAR_MM = 1.5, 5.0
"""Standard deviations of the Gaussians that average what the model is off, mm: the narrow one joins
the surface at the outline."""
_FAR_PART = 1e-3
"""Weight of the broad one."""
_ALIKE_MM = 10.0
"""A reading in an enclosed pocket that is so near to the model is of the face, mm."""
_SPECK = 4
"""Fewer readings of something else in a pocket are stray, every second point each way."""
_WHOLE = 0.99
"""Part of four points that are the face where all of them are."""
_HALF = 0.5
"""Part of a blurred area within which its outline lies."""
_NARROWEST_MM = 5.0
"""What is added makes no tongue narrower than this, mm."""


def beyond_outline(
    surface: SurfaceGrid, reader: DepthReader, pose: HeadPose | None = None
) -> SurfaceGrid:
    """Let a surface go on past its outline.

    reader : tells what the sensor read
    pose : the head's, about; None where it is not known
    """
    support = surface.support
    inside = support.inside
    # A model and averages need no more than every second point each way.
    heights, share = downsampled(surface.values[0]), downsampled(inside.astype(np.float32))
    step = 2 * support.step
    origin = (float(support.xs[0]) + support.step / 2, float(support.ys[0]) + support.step / 2)
    shown = (share > _WHOLE).astype(np.float32)
    fitted = fit_face(Heights(heights, shown, origin, step), pose)
    if fitted is None:
        return surface
    trend, known = fitted.heights(origin, step, heights.shape)
    np.copyto(trend, heights, where=~known)
    shown *= known
    rest = heights - trend
    off = np.abs(rest[shown > 0])
    if not len(off) or percentile(off, 50) > _MOST_OFF_MM:
        return surface
    trend += _smoothed(rest, shown, step)
    slopes = [np.asarray(cv2.Sobel(trend, cv2.CV_32F, right, 1 - right, ksize=3,
                                   scale=1 / (8 * step)), np.float32) for right in (1, 0)]

    def free(places: Bools, tolerance_mm: float) -> Bools:
        rows, columns = _places(places)
        z = trend[rows, columns]
        read = reader(np.column_stack([
            origin[0] + step * columns, origin[1] + step * rows, z]).astype(np.float32))
        found = np.zeros_like(places)
        found[rows, columns] = (read == 0) | (np.abs(read - z) < tolerance_mm)
        return found

    face, followed = share > 0, _followed(known, slopes)
    near = cv2.dilate(face.view(np.uint8), disc(_REACH_MM / step)) > 0
    wanted = _without_tongues(free(near & ~face & followed, 0), face, step)
    pockets = binary_fill_holes((wanted | face).view(np.uint8)) > (wanted | face)
    if pockets.any():
        wanted = _closed(wanted, pockets, free(pockets & known, _ALIKE_MM) & followed, known)
    added = _finer(wanted, face, inside.shape) & ~inside
    return _with(surface, added, [trend, *slopes]) if added.any() else surface


def _places(mask: Bools) -> tuple[Ints, Ints]:
    """Give rows and columns; `np.nonzero` takes several times as long."""
    rows, columns = np.divmod(np.flatnonzero(mask).astype(np.int32), np.int32(mask.shape[1]))
    return rows, columns


def _smoothed(rest: Floats, weight: Floats, step: float) -> Floats:
    """Average what the model is off, near by where that is known, else broadly."""
    planes = np.asarray(cv2.merge([rest * weight, weight]), np.float32)
    sums = blurred(planes, _NEAR_MM / step)
    half = cv2.resize(planes, None, fx=0.5, fy=0.5, interpolation=cv2.INTER_AREA)
    broad = blurred(np.asarray(half, np.float32), _FAR_MM / (2 * step))
    sums += np.float32(_FAR_PART) * cv2.resize(broad, rest.shape[::-1])
    return np.asarray(sums[..., 0] / np.maximum(sums[..., 1], np.float32(1e-9)), np.float32)


def _followed(known: Bools, slopes: list[Floats]) -> Bools:
    """Say where the model is followed: not next to its end, nor where it hides itself."""
    surrounded = cv2.erode(known.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    even = slopes[0] * slopes[0] + slopes[1] * slopes[1] < np.float32(_STEEPEST**2)
    return np.asarray(even & surrounded)


def _without_tongues(wanted: Bools, face: Bools, step: float) -> Bools:
    """Leave out what is narrow, makes the outline uneven, or is not joined to the face."""
    around = disc(_NARROWEST_MM / 2 / step)
    whole = (wanted | face).view(np.uint8)
    whole = cv2.dilate(cv2.erode(whole, around), around) | face.view(np.uint8)
    count, labels = cv2.connectedComponents(whole)
    joined = np.zeros(count, bool)
    joined[labels[face]] = True
    joined[0] = False
    even = blurred(whole.astype(np.float32), _NARROWEST_MM / 2 / step) > _HALF
    return np.asarray(wanted & joined[labels] & even)


def _closed(wanted: Bools, pockets: Bools, right: Bools, known: Bools) -> Bools:
    """Fill pockets that are mostly right and known as a whole; leave out what encloses others."""
    count, labels = cv2.connectedComponents(pockets.view(np.uint8), connectivity=4)
    areas, lost = (np.bincount(labels[some], minlength=count)
                   for some in (pockets, pockets & ~right))
    wrong = lost * 2 > np.maximum(areas, 2 * _SPECK)
    wrong[labels[pockets & ~known]] = True
    wrong[0] = False
    count, parts = cv2.connectedComponents((wanted | pockets).view(np.uint8))
    kept = np.ones(count, bool)
    kept[0] = False
    kept[parts[wrong[labels]]] = False
    return np.asarray(kept[parts])


def _finer(wanted: Bools, face: Bools, shape: tuple[int, ...]) -> Bools:
    """Give what is wanted on twice the points each way, up to the face: no slit is left between."""
    beside = cv2.dilate(wanted.view(np.uint8), np.ones((3, 3), np.uint8))
    each = cv2.resize(beside & (wanted | face).view(np.uint8), None, fx=2, fy=2,
                      interpolation=cv2.INTER_NEAREST)
    return np.asarray(each[:shape[0], :shape[1]].astype(bool))


def _with(surface: SurfaceGrid, added: Bools, halved: list[Floats]) -> SurfaceGrid:
    """Set heights and slopes where something is added, and at its next points outside.

    halved : what is set, at every second point each way
    """
    inside = surface.support.inside
    # The former outline is within now, and what the coarser points enclose.
    joint = cv2.dilate(added.view(np.uint8), np.ones((3, 3), np.uint8)) > 0
    support = surface.support.including(added | (joint & inside)).without_holes()
    touched = cv2.dilate((support.inside & ~inside).view(np.uint8), np.ones((3, 3), np.uint8))
    rows, columns = _places(touched.astype(bool) & ~inside)
    limits = [np.float32(side - 1.001) for side in halved[0].shape]
    y, x = (np.clip(np.float32(0.5) * (places.astype(np.float32) - np.float32(0.5)), 0, limit)
            for places, limit in zip((rows, columns), limits, strict=True))
    values = surface.values.copy()
    for plane, known in zip(values, halved, strict=True):
        plane[rows, columns] = interpolate(known, x, y)
    return replace(surface, values=values, support=support)
