"""A picture of a face: what was measured, what was made of it, and its shape without colour.

Points are splatted into a z-buffer with NumPy alone: no window, no GPU.
"""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import DenseCloud, Face
from denseface.service.export._lighting import shade
from denseface.service.export.mesh import triangulate

__all__ = ["render"]

_TURN_DEG = 35.0
_VIEWS = (("front", 0.0), (f"turned {_TURN_DEG:.0f} deg", _TURN_DEG))
_PANEL = 620
"""Width and height of one panel, pixels."""
_OVERSAMPLING = 2
_MARGIN, _HEADER, _FOOTER = 14, 74, 56
_FILL = 0.90
"""Share of a panel that the face may take."""
_BACKGROUND, _PANEL_COLOR = (20, 22, 24), (31, 34, 37)
_INK, _FAINT_INK = (236, 238, 240), (156, 162, 168)
_SEED_SHARE = 0.75
"""Side of the square drawn for a measured point, of their mean distance: the gaps show."""
_SUBDIVISIONS = 2
"""Points drawn along each edge of a triangle of the dense surface."""


@dataclass(frozen=True, eq=False)
class _Shape:
    points: NDArray[np.float32]
    side_mm: float
    """Side of the square drawn for each point."""


@dataclass(frozen=True)
class _Column:
    title: str
    shape: _Shape
    colors: NDArray[np.uint8]


def render(face: Face) -> bytes:
    """Draw a face: columns measured, dense, shape alone; rows front view and turned view.

    Parameters
    ----------
    face : any; the picture has one scale, given by a bar

    Returns
    -------
    bytes
        A PNG file.
    """
    initial, dense = face.initial, face.dense
    points, colors, normals = _filled(dense)
    seeds = _Shape(initial.points, _SEED_SHARE * face.report.mean_spacing_mm)
    surface = _Shape(points, dense.grid_step_mm)
    columns = (
        _Column(f"measured: {len(initial):,} points", seeds, initial.colors),
        _Column(f"dense: {len(dense):,} points", surface, colors),
        _Column("shape alone", surface, shade(normals)),
    )
    center = (dense.points.min(axis=0) + dense.points.max(axis=0)) / 2
    scale = _scale(dense.points - center)
    width = _MARGIN + len(columns) * (_PANEL + _MARGIN)
    height = _HEADER + len(_VIEWS) * (_PANEL + _MARGIN) + _FOOTER
    canvas = np.full((height, width, 3), _BACKGROUND, np.uint8)
    for row, (_, angle) in enumerate(_VIEWS):
        seen = {shape: _seen(shape, center, scale, angle) for shape in (seeds, surface)}
        for column, what in enumerate(columns):
            top = _HEADER + row * (_PANEL + _MARGIN)
            left = _MARGIN + column * (_PANEL + _MARGIN)
            pixels, points_seen = seen[what.shape]
            canvas[top:top + _PANEL, left:left + _PANEL] = _panel(
                pixels, what.colors[points_seen])
    _captions(canvas, columns, scale)
    encoded, png = cv2.imencode(".png", cv2.cvtColor(canvas, cv2.COLOR_RGB2BGR))
    if not encoded:
        raise RuntimeError("OpenCV could not write the PNG")
    return png.tobytes()


def _filled(
    dense: DenseCloud,
) -> tuple[NDArray[np.float32], NDArray[np.uint8], NDArray[np.float32]]:
    """Give the cloud's points and some on the triangles between, so that no gap is seen.

    Points, colours and normals; linear on each triangle.
    """
    corners = triangulate(dense)
    steps = range(_SUBDIVISIONS + 1)
    weights = np.array([(i, j, _SUBDIVISIONS - i - j) for i in steps for j in steps
                        if i + j <= _SUBDIVISIONS and max(i, j, _SUBDIVISIONS - i - j)
                        < _SUBDIVISIONS], np.float32) / _SUBDIVISIONS

    def spread(values: NDArray[Any]) -> NDArray[np.float32]:
        between = np.einsum("wc,tcx->wtx", weights, values.astype(np.float32)[corners])
        return np.concatenate([values.astype(np.float32), between.reshape(-1, 3)])

    normals = spread(dense.normals)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return spread(dense.points), np.round(spread(dense.colors)).astype(np.uint8), normals


def _turned(points: NDArray[np.float32], angle_deg: float) -> NDArray[np.float32]:
    angle = np.deg2rad(angle_deg)
    c, s = np.cos(angle), np.sin(angle)
    turned: NDArray[np.float32] = (points @ np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]]).T).astype(
        np.float32)
    return turned


def _scale(points: NDArray[np.float32]) -> float:
    """Give the pixels for each millimetre at which every view fits its panel."""
    extent = max(float(np.abs(_turned(points, angle)[:, :2]).max()) for _, angle in _VIEWS)
    return _FILL * _PANEL / 2 / max(extent, 1.0)


def _seen(
    shape: _Shape, center: NDArray[np.float32], scale: float, angle: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Give the pixels of a panel that are covered and which point each shows."""
    size = _PANEL * _OVERSAMPLING
    fine = scale * _OVERSAMPLING
    points = _turned(shape.points - center, angle)
    order = np.argsort(-points[:, 2])  # the nearest is drawn last
    u, v = np.floor(points[order, :2] * fine + size / 2).astype(np.intp).T
    inside = np.flatnonzero((u >= 0) & (u < size) & (v >= 0) & (v < size))
    rank = np.full((size, size), -1.0)
    rank[v[inside], u[inside]] = inside  # of equal places the last counts
    side = max(2, round(shape.side_mm * fine))
    # The highest rank within reach: each point a square, nearer ones over farther ones.
    rank = cv2.dilate(rank, np.ones((side, side), np.uint8))
    pixels = np.flatnonzero(rank >= 0)
    return pixels, order[rank.ravel()[pixels].astype(np.intp)]


def _panel(pixels: NDArray[np.intp], colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    size = _PANEL * _OVERSAMPLING
    image = np.full((size * size, 3), _PANEL_COLOR, np.uint8)
    image[pixels] = colors
    return np.asarray(cv2.resize(
        image.reshape(size, size, 3), (_PANEL, _PANEL), interpolation=cv2.INTER_AREA), np.uint8)


def _captions(canvas: NDArray[np.uint8], columns: tuple[_Column, ...], scale: float) -> None:
    for column, what in enumerate(columns):
        left = _MARGIN + column * (_PANEL + _MARGIN)
        _write(canvas, what.title, (left + 2, _HEADER - 24), 0.95, _INK)
    for row, (name, _) in enumerate(_VIEWS):
        _write(canvas, name, (_MARGIN + 14, _HEADER + row * (_PANEL + _MARGIN) + 30), 0.6,
               _FAINT_INK)
    bar_mm = 50
    y = canvas.shape[0] - 26
    end = _MARGIN + round(bar_mm * scale)
    cv2.line(canvas, (_MARGIN, y), (end, y), _INK, 2, cv2.LINE_AA)
    for x in (_MARGIN, end):
        cv2.line(canvas, (x, y - 6), (x, y + 6), _INK, 2, cv2.LINE_AA)
    _write(canvas, f"{bar_mm} mm", (end + 14, y + 7), 0.6, _INK)


def _write(canvas: NDArray[np.uint8], text: str, at: tuple[int, int], size: float,
           ink: tuple[int, int, int]) -> None:
    cv2.putText(canvas, text, at, cv2.FONT_HERSHEY_DUPLEX, size, ink, 1, cv2.LINE_AA)
