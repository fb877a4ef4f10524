"""A mesh's texture, from the colour image of its frame, and where each point is in it."""

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.capture.frame import RgbdFrame
from denseface.service.errors import UsageError
from denseface.service.export.mesh import FaceMesh
from denseface.service.export.options import Texture

__all__ = ["Textured", "of_frame", "of_points", "textured"]

_QUALITY, _QUALITY_OF_POINTS = 95, 90
"""Of JPEGs, 0-100, with colours at full resolution. Points' own colours are a smoothed image."""
_PARTS = 16
"""Of a pixel of a photograph."""

_MARGIN = 8
"""Around what is seen of the face in the colour image, pixels."""
_FRAME = 2
"""Around each patch of points' own colours, of what is at its edge: pixels."""
_MIXED = 2
"""Along the outline of the face, pixels of the colour image that are of the background too."""


class Textured(NamedTuple):
    """A mesh and its texture."""

    mesh: FaceMesh
    """Points on a seam are there twice."""
    uv: NDArray[np.float64]
    """(n, 2), 0-1, of each point: from the image's upper left corner, right and down."""
    jpeg: bytes
    size: tuple[int, int]
    """Width and height, pixels."""
    parts: int
    """Of a pixel, to which places may be rounded."""


def textured(mesh: FaceMesh, source: Texture) -> Textured:
    """Give a mesh the texture that `ExportOptions.texture` names; raises as `of_frame`."""
    return of_points(mesh) if source == "points" else of_frame(mesh, source)


def of_points(mesh: FaceMesh) -> Textured:
    """Make a texture of the points' own colours: a pixel for each place of the grid."""
    image, corner = _grid_image(mesh.cells, mesh.colors)
    size = image.shape[1], image.shape[0]
    uv = ((mesh.cells - corner)[:, ::-1] + 0.5) / size
    return Textured(mesh, uv, _jpeg(image, _QUALITY_OF_POINTS), size, 1)


def of_frame(mesh: FaceMesh, frame: RgbdFrame) -> Textured:
    """Take a mesh's colours from the colour image of the frame that it was made of.

    The points are projected into the colour camera. Along the outline, where a pixel is of the
    background too, they have the colour a little farther inside. Triangles with a corner that the
    camera does not see, because something is before it or it is beyond the image's edge, have the
    points' own colours: they stand right of the photograph, a pixel for each place of the grid.

    Raises
    ------
    UsageError
        The frame has no colour image, or the face is not in it.
    """
    # Here: the points' own colours need none of its compiled loops.
    from denseface.recon.registration import register, sample_colors

    if frame.color is None:
        raise UsageError("texture: the frame has no colour image")
    _, seen = sample_colors(frame, register(frame, colors=False), mesh.points)
    whole = seen[mesh.triangles].all(axis=1)
    if not whole.any():
        raise UsageError("texture: the face is not in this frame's colour image: is it another "
                         "frame's?")
    places = _project(mesh.points, frame)
    places[seen] = _inward(places[seen], frame.color.shape[:2])
    shown = places[np.unique(mesh.triangles[whole])]
    height, width = frame.color.shape[:2]
    low = np.maximum(np.floor(shown.min(axis=0)).astype(int) - _MARGIN, 0)
    high = np.minimum(np.ceil(shown.max(axis=0)).astype(int) + _MARGIN + 1, (width, height))
    # A point of both kinds of triangles is there twice: each has its own place in the texture.
    hidden = mesh.triangles[~whole]
    own = np.unique(hidden)
    image, places_of_own = _with_own(
        frame.color[low[1]:high[1], low[0]:high[0]], mesh.cells[own], mesh.colors[own])
    twin = np.zeros(len(mesh.points), np.int32)
    twin[own] = len(mesh.points) + np.arange(len(own), dtype=np.int32)
    triangles = mesh.triangles.copy()
    triangles[~whole] = twin[hidden]
    used, numbers = np.unique(triangles, return_inverse=True)
    rows = np.concatenate([np.arange(len(mesh.points)), own])[used]
    done = FaceMesh(mesh.points[rows], mesh.normals[rows], mesh.colors[rows], mesh.cells[rows],
                    numbers.reshape(-1, 3).astype(np.int32), mesh.step_mm)
    size = image.shape[1], image.shape[0]
    uv = (np.concatenate([places - low, places_of_own])[used] + 0.5) / size
    return Textured(done, uv, _jpeg(image, _QUALITY), size, _PARTS)


def _project(points: NDArray[np.float32], frame: RgbdFrame) -> NDArray[np.float64]:
    """Give where the colour camera sees points: (n, 2), pixels (u, v)."""
    pose = frame.depth_to_color
    there = points @ np.array(pose.rotation, np.float64).T + np.array(pose.translation_mm)
    there[:, 2] = np.maximum(there[:, 2], 1.0)  # behind it nothing is seen
    return frame.calibration.color.project(there)


def _inward(places: NDArray[np.float64], size: tuple[int, int]) -> NDArray[np.float64]:
    """Move what is at the outline to the nearest pixel that is of the face alone.

    Parameters
    ----------
    places : (n, 2), (u, v), within an image of that height and width
    """
    columns, rows = np.rint(places).astype(int).T.clip(0, [[size[1] - 1], [size[0] - 1]])
    covered = np.zeros(size, np.uint8)
    covered[rows, columns] = 1
    closed = cv2.morphologyEx(covered, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    side = 2 * _MIXED + 1
    inside = np.asarray(cv2.erode(closed, np.ones((side, side), np.uint8)), np.uint8)
    if not inside.any():
        return places
    _, labels = cv2.distanceTransformWithLabels(
        1 - inside, cv2.DIST_L2, cv2.DIST_MASK_5, labelType=cv2.DIST_LABEL_PIXEL)
    pixel = np.zeros((int(labels.max()) + 1, 2))
    v, u = np.nonzero(inside)
    pixel[labels[v, u]] = np.stack([u, v], axis=1)
    mixed = inside[rows, columns] == 0
    moved = places.copy()
    moved[mixed] = pixel[labels[rows[mixed], columns[mixed]]]
    return moved


def _with_own(
    photo: NDArray[np.uint8], cells: NDArray[np.int32], colors: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.float64]]:
    """Put the colours of points right of a photograph, each patch of the grid by itself.

    Returns
    -------
    image : (H, W, 3), RGB
    places : (n, 2), (u, v) of each point in it
    """
    places = np.zeros((len(cells), 2))
    if not len(cells):
        return photo, places
    corner = cells.min(axis=0)
    taken = np.zeros(cells.max(axis=0) - corner + 1, np.uint8)
    taken[tuple((cells - corner).T)] = 1
    count, labels = cv2.connectedComponents(taken, connectivity=8)
    of = labels[tuple((cells - corner).T)]
    patches = [np.flatnonzero(of == label) for label in range(1, count)]
    patches.sort(key=lambda patch: -int(np.ptp(cells[patch, 1])))
    left, top, column = photo.shape[1], 0, 0
    parts = [(0, 0, photo)]
    for patch in patches:
        painted, first = _grid_image(cells[patch], colors[patch])
        framed = cv2.copyMakeBorder(painted, _FRAME, _FRAME, _FRAME, _FRAME,
                                    cv2.BORDER_REPLICATE)
        if top and top + len(framed) > len(photo):
            left, top, column = left + column, 0, 0
        parts.append((left, top, np.asarray(framed, np.uint8)))
        places[patch] = (cells[patch] - first)[:, ::-1] + (left + _FRAME, top + _FRAME)
        top, column = top + len(framed), max(column, framed.shape[1])
    size = (max(y + len(part) for _, y, part in parts),
            max(x + part.shape[1] for x, _, part in parts), 3)
    image = np.full(size, np.rint(colors.mean(axis=0)), np.uint8)
    for x, y, part in parts:
        image[y:y + len(part), x:x + part.shape[1]] = part
    return image, places


def _grid_image(
    cells: NDArray[np.int32], colors: NDArray[np.uint8]
) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
    """Give points' colours as an image, a pixel for each place of the grid.

    Empty places have the colour of the nearest point: what blends with them shows no edge.

    Returns
    -------
    image : (H, W, 3), RGB
    corner : (2,), row and column of its first pixel
    """
    corner = cells.min(axis=0)
    height, width = cells.max(axis=0) - corner + 1
    image = np.zeros((height, width, 3), np.uint8)
    empty = np.ones((height, width), np.uint8)
    rows, columns = (cells - corner).T
    image[rows, columns] = colors
    empty[rows, columns] = 0
    if empty.any():
        _, nearest = cv2.distanceTransformWithLabels(
            empty, cv2.DIST_L2, cv2.DIST_MASK_3, labelType=cv2.DIST_LABEL_PIXEL)
        of_label = np.zeros((int(nearest.max()) + 1, 3), np.uint8)
        of_label[nearest[rows, columns]] = colors
        image = of_label[nearest]
    return image, corner


def _jpeg(image: NDArray[np.uint8], quality: int) -> bytes:
    """Give an (H, W, 3) RGB image as a JPEG with its colours at full resolution."""
    encoded, data = cv2.imencode(
        ".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR),
        [cv2.IMWRITE_JPEG_QUALITY, quality, cv2.IMWRITE_JPEG_SAMPLING_FACTOR,
         cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444, cv2.IMWRITE_JPEG_OPTIMIZE, 1])
    if not encoded:
        raise RuntimeError("OpenCV could not write the JPEG")
    return data.tobytes()
