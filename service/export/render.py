"""A rendering of a face: measured points, dense points, shape without colour.

Points are splatted into a z-buffer by NumPy and OpenCV: no window, no GPU.
"""

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.arguments import expect
from denseface.recon.face import DenseCloud, Face
from denseface.service.export._drawing import BACKGROUND, FAINT_INK, INK, png, write
from denseface.service.export._lighting import shade
from denseface.service.export.mesh import triangulate
from denseface.service.export.provenance import provenance

__all__ = ["portrait", "render"]

_TURN_DEG = 35.0
"""Angle of the turned view about the vertical, degrees."""
_VIEWS = (("front", 0.0), (f"turned {_TURN_DEG:.0f} deg", _TURN_DEG))
"""Caption and angle of each row, degrees."""
_PANEL = 620
"""Width and height of one panel, pixels."""
_OVERSAMPLING = 2
"""Pixels drawn for each pixel of a panel, along each side."""
_MARGIN, _HEADER, _FOOTER = 14, 74, 56
"""Around each panel, above and below all, pixels."""
_FILL = 0.90
"""Share of a panel's width and height that the face may take."""
_PANEL_COLOR = (31, 34, 37)
"""RGB."""
_SCALE_BAR_MM = 50
_SEED_SHARE = 0.75
"""Side of the square of a measured point, in mean spacings: the gaps between points show."""
_SUBDIVISIONS = 2
"""Parts of each edge of a triangle; points are drawn where they meet."""


def render(face: Face) -> bytes:
    """Draw a face as a PNG file: columns measured, dense, shape alone; rows front and turned view.

    The picture has one scale, given by a bar.
    """
    expect("face", face, Face)
    initial, dense = face.initial, face.dense
    points, colors, normals = _subdivided(dense)
    shading = shade(normals)
    titles = (f"measured: {len(initial):,} points", f"dense: {len(dense):,} points", "shape alone")
    center = (dense.points.min(axis=0) + dense.points.max(axis=0)) / 2
    scale = _scale(dense.points - center)
    width = _MARGIN + len(titles) * (_PANEL + _MARGIN)
    height = _HEADER + len(_VIEWS) * (_PANEL + _MARGIN) + _FOOTER
    canvas = np.full((height, width, 3), BACKGROUND, np.uint8)
    for row, (_, angle) in enumerate(_VIEWS):
        seeds = _visible(initial.points - center, scale, angle,
                         _SEED_SHARE * face.report.mean_spacing_mm)
        surface = _visible(points - center, scale, angle, dense.grid_step_mm)
        top = _HEADER + row * (_PANEL + _MARGIN)
        for column, ((pixels, rows), shown) in enumerate((
                (seeds, initial.colors), (surface, colors), (surface, shading))):
            left = _MARGIN + column * (_PANEL + _MARGIN)
            canvas[top:top + _PANEL, left:left + _PANEL] = _panel(pixels, shown[rows])
    _captions(canvas, titles, scale)
    return png(canvas, provenance(face.report))


def portrait(face: Face, side: int) -> bytes:
    """Draw the dense face from the front as a PNG file, square, without words.

    Parameters
    ----------
    side : width and height, pixels
    """
    dense = face.dense
    points, colors = dense.points, dense.colors
    center = (points.min(axis=0) + points.max(axis=0)) / 2
    scale = _scale(points - center, side)
    if scale * _OVERSAMPLING * dense.grid_step_mm > 1:  # else neighbours share a pixel
        points, colors, _ = _subdivided(dense)
    pixels, rows = _visible(points - center, scale, 0.0, dense.grid_step_mm, side)
    return png(_panel(pixels, colors[rows], side), provenance(face.report))


def _subdivided(
    dense: DenseCloud,
) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32]]:
    """Give points, colours and normals, and more on the triangles between: no gap is seen.

    Linear on each triangle.
    """
    corners = triangulate(dense)
    steps = range(_SUBDIVISIONS + 1)
    weights = np.array([(i, j, _SUBDIVISIONS - i - j) for i in steps for j in steps
                        if i + j <= _SUBDIVISIONS and max(i, j, _SUBDIVISIONS - i - j)
                        < _SUBDIVISIONS], np.float32) / _SUBDIVISIONS

    def refine(values: NDArray[Any]) -> NDArray[np.float32]:
        between = np.einsum("wc,tcx->wtx", weights, values.astype(np.float32)[corners])
        return np.concatenate([values.astype(np.float32), between.reshape(-1, 3)])

    normals = refine(dense.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return refine(dense.points), np.round(refine(dense.colors)).astype(np.uint8), normals


def _rotated(points: NDArray[np.float32], angle_deg: float) -> NDArray[np.float32]:
    """Rotate about the vertical."""
    angle = np.deg2rad(angle_deg)
    c, s = np.cos(angle), np.sin(angle)
    rotation = np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])
    return np.asarray(points @ rotation.T, np.float32)


def _scale(points: NDArray[np.float32], panel: int = _PANEL) -> float:
    """Give the pixels for each millimetre at which every view fits a panel."""
    extent = max(float(np.abs(_rotated(points, angle)[:, :2]).max()) for _, angle in _VIEWS)
    return _FILL * panel / 2 / max(extent, 1.0)


def _visible(
    points: NDArray[np.float32], scale: float, angle: float, side_mm: float, panel: int = _PANEL
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give the pixels covered by squares of a side, and the row of the point that each shows."""
    size = panel * _OVERSAMPLING
    fine = scale * _OVERSAMPLING
    points = _rotated(points, angle)
    order = np.argsort(-points[:, 2])  # the nearest is drawn last
    u, v = np.floor(points[order, :2] * fine + size / 2).astype(np.intp).T
    inside = np.flatnonzero((u >= 0) & (u < size) & (v >= 0) & (v < size))
    rank = np.full((size, size), -1.0)
    rank[v[inside], u[inside]] = inside  # where several share a pixel, the last one stays
    side = max(2, round(side_mm * fine))
    # The highest rank within reach: each point a square, nearer ones over farther ones.
    rank = cv2.dilate(rank, np.ones((side, side), np.uint8))
    pixels = np.flatnonzero(rank >= 0)
    return pixels, order[rank.ravel()[pixels].astype(np.intp)]


def _panel(
    pixels: NDArray[np.intp], colors: NDArray[np.uint8], panel: int = _PANEL
) -> NDArray[np.uint8]:
    size = panel * _OVERSAMPLING
    image = np.full((size * size, 3), _PANEL_COLOR, np.uint8)
    image[pixels] = colors
    return np.asarray(cv2.resize(
        image.reshape(size, size, 3), (panel, panel), interpolation=cv2.INTER_AREA), np.uint8)


def _captions(canvas: NDArray[np.uint8], titles: tuple[str, ...], scale: float) -> None:
    for column, title in enumerate(titles):
        left = _MARGIN + column * (_PANEL + _MARGIN)
        write(canvas, title, (left + 2, _HEADER - 24), 0.95, INK)
    for row, (name, _) in enumerate(_VIEWS):
        write(canvas, name, (_MARGIN + 14, _HEADER + row * (_PANEL + _MARGIN) + 30), 0.6,
               FAINT_INK)
    y = canvas.shape[0] - 26
    end = _MARGIN + round(_SCALE_BAR_MM * scale)
    cv2.line(canvas, (_MARGIN, y), (end, y), INK, 2, cv2.LINE_AA)
    for x in (_MARGIN, end):
        cv2.line(canvas, (x, y - 6), (x, y + 6), INK, 2, cv2.LINE_AA)
    write(canvas, f"{_SCALE_BAR_MM} mm", (end + 14, y + 7), 0.6, INK)
