"""Wavefront's `.obj`: its points with the colours that many programs put behind them, its faces."""

import io

import numpy as np

from denseface.service.export.reading.meshes import RawMesh
from denseface.service.export.reading.polygons import fan, to_bytes

__all__ = ["from_obj"]

_MAX_LINES = 1 << 22
"""Of points, and of faces: each is a list of its own."""


def from_obj(data: bytes) -> RawMesh:
    """Read a file's bytes; ValueError says what is wrong with them."""
    points: list[list[float]] = []
    polygons: list[list[int]] = []
    for number, line in enumerate(io.BytesIO(data.replace(b"\\\n", b" ")), 1):
        kind, _, rest = line.lstrip().partition(b" ")
        try:
            if kind == b"v":
                points.append([float(token) for token in rest.split()])
            elif kind == b"f":
                polygons.append([_row(int(token.partition(b"/")[0]), len(points))
                                 for token in rest.split()])
        except ValueError as error:
            raise ValueError(f"line {number}: {error}") from error
        if max(len(points), len(polygons)) > _MAX_LINES:
            raise ValueError(f"more than {_MAX_LINES} points or faces")
    if not points:
        raise ValueError("has no points: no line begins with 'v'")
    widths = {len(row) for row in points}
    if min(widths) < 3 or max(widths) > 7:
        raise ValueError("a point has fewer than 3 or more than 7 numbers")
    colors = None
    if min(widths) >= 6:
        colors = to_bytes(np.array([row[3:6] for row in points]))
    rows = [np.array(row) for row in polygons if len(row) != 3]
    threes = np.array([row for row in polygons if len(row) == 3], np.int64).reshape(-1, 3)
    triangles = np.concatenate([threes, fan(rows)])
    return RawMesh(np.array([row[:3] for row in points]), triangles, colors)


def _row(number: int, named: int) -> int:
    """Give the row of a point: numbers are from 1, or back from the last named; -1 is none."""
    if number < 0:
        return max(number + named, -1)
    return number - 1
