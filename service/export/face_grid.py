"""A face for a browser: the dense grid and the initial cloud in a fifth of a megabyte.

`docs/wire.md` describes the bytes, so that others can read them; this page's reader is
`service/kiosk/frontend/src/face_grid.ts`. Normals are left out: they follow from the grid.
"""

import json
import struct
import zlib
from typing import cast

import numpy as np
from numpy.typing import NDArray

from denseface.recon.arrays import Bools, Bytes, Floats, Ints
from denseface.recon.face import DenseCloud, Face

__all__ = ["MAGIC", "UNIT_MM", "VERSION", "encode_face_grid"]

MAGIC, VERSION = b"DFGR", 1
"""How a face's grid begins."""
UNIT_MM = 0.01
"""What depths and the initial cloud's coordinates are rounded to, mm."""
_REACH = 2**28
"""Units: a coordinate beyond, 2.7 km away, would overflow what is sent of it."""
_LONG = 255
"""Stands in the bytes for a residual that has 32 bits of its own."""
_SIGMA_CODES = 255
"""Steps of sigma's scale, which is even in its logarithm."""
_STRATEGY = zlib.Z_HUFFMAN_ONLY
"""Residuals do not repeat: at 148,222 points 229 kB in 5 ms, where looking for repeats gives 218 kB
in 25 ms (level 4) and 205 kB in 70 ms (level 6)."""
_MEMORY = 9
"""Of zlib: the largest blocks."""


def encode_face_grid(face: Face) -> bytes:
    """Give a face's dense grid and initial cloud as bytes, to be read in a browser.

    Depths and the initial cloud's coordinates are rounded to 0.01 mm, sigma to 1/255 of the
    logarithm of its range; colours are exact.

    ValueError where a point is not at its place on the grid, to 0.005 mm, or 2.7 km away.
    """
    dense, seeds = face.dense, face.initial
    left, top = _corner(dense)
    places = _Places(dense.cells, dense.grid_shape)
    low, high = ((float(dense.sigma.min()), float(dense.sigma.max())) if len(dense)
                 else (1.0, 1.0))
    depths, long_depths = _short(places.residuals(_units(dense.points[:, 2]), np.int32))
    painted = np.empty((len(dense), 4), np.uint8)
    painted[:, :3], painted[:, 3] = dense.colors, _sigma_codes(dense.sigma, low, high)
    paint = places.residuals(painted.view(np.int32).ravel(), np.uint8)
    steps = np.diff(_units(seeds.points), axis=0, prepend=np.int32(0))
    ways, long_ways = _short(steps.T.ravel())
    header = {
        "points": len(dense), "rows": int(dense.grid_shape[0]), "columns": int(dense.grid_shape[1]),
        "left_mm": left, "top_mm": top, "step_mm": float(dense.grid_step_mm), "unit_mm": UNIT_MM,
        "sigma_mm": [low, high], "long": len(long_depths), "seeds": len(seeds),
        "long_of_seeds": len(long_ways), "spacing_mm": face.report.mean_spacing_mm,
    }
    text = json.dumps(header, separators=(",", ":")).encode()
    seed_colors = np.diff(seeds.colors, axis=0, prepend=np.uint8(0))
    body = b"".join(np.ascontiguousarray(part).tobytes() for part in (
        np.packbits(places.on, axis=1), depths, paint.view(np.uint8).reshape(-1, 4).T,
        long_depths, ways, seed_colors.T, long_ways))
    packer = zlib.compressobj(strategy=_STRATEGY, memLevel=_MEMORY)
    return b"".join((MAGIC, struct.pack("<II", VERSION, len(text)), text,
                     packer.compress(body), packer.flush()))


class _Places:
    """Where a grid has points, and what is to be expected there.

    The arrays have an empty row above and an empty column to the left, and 32 bits for each place:
    a depth, or four bytes that are computed at once.
    """

    def __init__(self, cells: Ints, shape: tuple[int, int]) -> None:
        self._shape = shape[0] + 1, shape[1] + 1
        self._at = (cells[:, 0] + 1) * self._shape[1] + cells[:, 1] + 1
        known = np.zeros(self._shape, np.bool_)
        known.ravel()[self._at] = True
        self.on: Bools = known[1:, 1:]
        with_left = known[1:, :-1]
        # All bits set where it is so: they take or leave a difference.
        self._plane = -(with_left & known[:-1, 1:] & known[:-1, :-1]).astype(np.int32)
        self._first = -(~with_left).astype(np.int32)

    def residuals(self, values: Ints, lane: type[np.uint8] | type[np.int32]) -> Ints:
        """Subtract from each point's value what its neighbours let expect.

        The plane through the left, the upper and the upper left one where there are all three, else
        the left one, else the upper one, else 0. Of a value, each `lane` by itself; bytes wrap
        around.
        """
        grid = np.zeros(self._shape, np.int32)
        grid.ravel()[self._at] = values
        # For the type checker all are whole numbers alike.
        lanes, plane, first = (cast("Ints", array.view(lane))
                               for array in (grid, self._plane, self._first))
        step = lanes.shape[1] // self._shape[1]
        above = lanes[:-1, step:]
        left = lanes[1:, step:] - lanes[1:, :-step]
        left -= (above - lanes[:-1, :-step]) & plane
        left -= above & first
        return left.view(np.int32)[self.on]


def _corner(dense: DenseCloud) -> tuple[float, float]:
    """Give x and y of the grid's first column and row, mm."""
    step, corner = dense.grid_step_mm, []
    for axis, cells in ((0, dense.cells[:, 1]), (1, dense.cells[:, 0])):
        own = dense.points[:, axis] - cells * step
        low, high = (float(own.min()), float(own.max())) if len(own) else (0.0, 0.0)
        if high - low > UNIT_MM:
            raise ValueError(f"{'xy'[axis]} is not on a grid of {step:g} mm")
        corner.append((low + high) / 2)
    return corner[0], corner[1]


def _units(lengths: Floats) -> Ints:
    """Round lengths, mm, to units."""
    units = np.rint(lengths * np.float64(1 / UNIT_MM))
    if units.size and np.abs(units).max() > _REACH:
        raise ValueError(f"a coordinate is beyond {_REACH * UNIT_MM / 1e6:.1f} km")
    return units.astype(np.int32)


def _short(residuals: Ints) -> tuple[Bytes, NDArray[np.uint32]]:
    """Give a byte for each residual, and 32 bits for those that need them.

    A residual r is 2r, a negative one -2r - 1, so that small ones are small numbers.
    """
    folded = ((residuals << 1) ^ (residuals >> 31)).view(np.uint32)
    return (np.minimum(folded, _LONG).astype(np.uint8),
            np.asarray(folded[folded >= _LONG], "<u4"))


def _sigma_codes(sigma: Floats, low: float, high: float) -> Bytes:
    """Place sigma between its least, 0, and its greatest, 255, by its logarithm."""
    if low == high:
        return np.zeros(len(sigma), np.uint8)
    scale = np.float32(_SIGMA_CODES / np.log(high / low))
    codes = np.rint(np.log(sigma / np.float32(low)) * scale)
    return np.asarray(np.clip(codes, 0, _SIGMA_CODES), np.uint8)
