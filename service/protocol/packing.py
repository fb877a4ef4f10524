"""A dense cloud in a third of its bytes.

Left out is what follows from the rest: x and y, which a point's cell gives, and a normal's length
and z. Normals keep 0.003 degrees and `sigma` 0.05 %, far finer than either is known; points,
colours and cells are exact.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from denseface.recon.face import DenseCloud

_UNIT = 32767
"""Stands for 1 in a normal's component."""
_SIGMA_MM = 1e-4, 65e3
"""Least and greatest sigma, mm: the range of a normalised float16."""


@dataclass(frozen=True, eq=False)
class PackedCloud:
    """A `DenseCloud` as it is sent and stored; depth camera frame.

    Attributes
    ----------
    support : (rows, ceil(columns / 8)) uint8, one bit for each place on the grid, the highest
        first: 1 where there is a point. Points are in this order, row by row.
    x, y : (columns,), (rows,) float32, mm; any number in a column or row without points
    z : (n,) float32, mm
    colors : (n, 3) uint8, RGB
    normals : (n, 2) int16, x and y of the unit normal, times 32767; z is negative
    sigma : (n,) float16, mm
    grid_shape, grid_step_mm : as of the cloud

    ValueError where a coordinate is not finite, sigma not positive, or there are not as many points
    as places with one.
    """

    support: NDArray[np.uint8]
    x: NDArray[np.float32]
    y: NDArray[np.float32]
    z: NDArray[np.float32]
    colors: NDArray[np.uint8]
    normals: NDArray[np.int16]
    sigma: NDArray[np.float16]
    grid_shape: tuple[int, int]
    grid_step_mm: float

    def __post_init__(self) -> None:
        for name in ("x", "y", "z"):
            if not np.isfinite(getattr(self, name)).all():
                raise ValueError(f"{name} must be finite")
        bits = self.sigma.view(np.uint16)  # ordered like the numbers, infinity above them
        if len(bits) and not 0 < bits.min() <= bits.max() < _INFINITE:
            raise ValueError("sigma must be positive and finite")
        beyond = -self.grid_shape[1] % 8
        if self.support.size and (self.support[:, -1] & ((1 << beyond) - 1)).any():
            raise ValueError(f"support must lie on the {self.grid_shape} grid")
        places = int(np.bitwise_count(self.support).sum())
        if places != len(self.z):
            raise ValueError(f"support has {places} places for {len(self.z)} points")


    def check_grid(self) -> None:
        """Check that columns and rows are `grid_step_mm` apart; ValueError where they are not."""
        columns = np.unpackbits(np.bitwise_or.reduce(self.support, axis=0),
                                count=self.grid_shape[1])
        for name, places, used in (("x", self.x, columns), ("y", self.y, self.support.any(axis=1))):
            at = np.flatnonzero(used)
            given = places[at].astype(np.float64)
            off = given - given[0] - (at - at[0]) * self.grid_step_mm
            allowed = _OFF_GRID * self.grid_step_mm + _ROUNDING * np.abs(given).max()
            if np.abs(off).max() > allowed:
                raise ValueError(f"{name} is not on a grid of {self.grid_step_mm:g} mm")


_OFF_GRID = 1e-3
"""How far a column or row may be from its place, steps of the grid."""
_ROUNDING = 4 * float(np.finfo(np.float32).eps)
"""As `_OFF_GRID`, by its coordinate: what 32 bits round away."""
_INFINITE = int(np.array(np.inf, np.float16).view(np.uint16))
"""The bits of infinity as a float16."""


def pack(cloud: DenseCloud) -> PackedCloud:
    """Pack a cloud.

    ValueError where a point is not at its place on a grid, they are not sorted, a normal points
    away from the camera, or sigma is beyond what 16 bits hold in full (0.0001 to 65,000 mm).
    """
    # Importing numba takes most of a second, which a reader of faces need not wait for.
    from denseface.service.protocol import _packing_kernels

    rows, columns = cloud.grid_shape
    done, support, x, y, z, normals = _packing_kernels.pack(
        cloud.points, cloud.normals, cloud.cells, rows, columns, _UNIT)
    if done < len(cloud):
        raise ValueError(f"point {done} is not at its place on a grid, not behind the one before, "
                         "or its normal points away from the camera")
    least, most = _SIGMA_MM
    if len(cloud) and not least <= cloud.sigma.min() <= cloud.sigma.max() <= most:
        raise ValueError(f"sigma must be within {least} and {most:.0f} mm")
    sigma = _packing_kernels.to_float16_bits(cloud.sigma.view(np.uint32)).view(np.float16)
    return PackedCloud(support, x, y, z, cloud.colors, normals, sigma,
                       (int(rows), int(columns)), float(cloud.grid_step_mm))


def unpack(packed: PackedCloud) -> DenseCloud:
    """Restore a cloud, its normals of unit length again."""
    rows, columns = packed.grid_shape
    n = len(packed.z)
    occupied = np.unpackbits(packed.support, axis=1, count=columns).view(np.bool_)
    points_per_row = np.bitwise_count(packed.support).sum(axis=1, dtype=np.intp)
    cells = np.empty((n, 2), np.int32)
    cells[:, 0] = np.repeat(np.arange(rows, dtype=np.int32), points_per_row)
    cells[:, 1] = np.broadcast_to(np.arange(columns, dtype=np.int32), occupied.shape)[occupied]
    points = np.empty((n, 3), np.float32)
    points[:, 0] = np.broadcast_to(packed.x, occupied.shape)[occupied]
    points[:, 1] = np.repeat(packed.y, points_per_row)
    points[:, 2] = packed.z
    tilts = packed.normals * np.float32(1 / _UNIT)
    squared_z = 1 - tilts[:, 0] ** 2 - tilts[:, 1] ** 2
    too_long = squared_z < 0  # x and y were rounded up
    if too_long.any():
        tilts[too_long] /= np.sqrt(1 - squared_z[too_long])[:, None]
        squared_z[too_long] = 0
    normals = np.empty((n, 3), np.float32)
    normals[:, :2] = tilts
    normals[:, 2] = -np.sqrt(squared_z)
    return DenseCloud(points, packed.colors, normals, packed.sigma.astype(np.float32), cells,
                      packed.grid_shape, packed.grid_step_mm)


def warm_packing() -> None:
    """Load or compile the kernels of `pack`, for which the first face would wait otherwise."""
    one = np.zeros(1, np.float32)
    pack(DenseCloud(
        np.zeros((1, 3), np.float32), np.zeros((1, 3), np.uint8),
        np.array([[0, 0, -1]], np.float32), one + 1, np.zeros((1, 2), np.int32), (1, 1), 1.0))
