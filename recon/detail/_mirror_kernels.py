"""A height field's mirror image in a plane, compiled.

A plane is a unit normal and an offset: n . p = offset. `field` is (rows, columns, k) float32, its
first plane the height, mm, the second the share of a point's normal that looks along z, the third
its weight; places in it are grid points from `origin`, (x, y) mm, `step` apart. Where `origin` has
a z, heights count from -z.
"""

import math

import numpy as np
from numpy.typing import NDArray

from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

__all__ = ["mirror_costs", "mirror_image", "principal_curvature_angle", "refine_plane",
           "sample_points"]


@compiled
def sample_points(
    field: NDArray[np.float32], origin: NDArray[np.float64], step: float, every: int,
    facing: float,
) -> NDArray[np.float64]:
    """Give every so many of a field's points, (n, 3), that count and look along z by so much."""
    rows, columns = field.shape[:2]
    points = np.empty(((rows // every + 1) * (columns // every + 1), 3))
    count = 0
    for i in range(0, rows, every):
        for j in range(0, columns, every):
            if field[i, j, 2] > 0 and field[i, j, 1] > facing:
                points[count, 0] = origin[0] + step * j
                points[count, 1] = origin[1] + step * i
                points[count, 2] = field[i, j, 0]
                count += 1
    return points[:count].copy()


@compiled
def principal_curvature_angle(points: NDArray[np.float64]) -> float:
    """Give the direction across the view in which points about their middle curve away most.

    points : (n, 3); gives the angle from x toward y
    """
    matrix, right, term = np.zeros((6, 6)), np.zeros(6), np.ones(6)
    for i in range(len(points)):
        x, y, z = points[i]
        term[1], term[2] = x, y
        term[3], term[4], term[5] = x * x / 2, x * y, y * y / 2
        for j in range(6):
            right[j] += term[j] * z
            for k in range(6):
                matrix[j, k] += term[j] * term[k]
    fit = solve_small(matrix, right)
    # The second axis of a symmetric matrix of two rows.
    return math.atan2(2 * fit[4], fit[3] - fit[5]) / 2


@compiled
def mirror_costs(
    field: NDArray[np.float32], origin: NDArray[np.float64], step: float,
    points: NDArray[np.float64], normals: NDArray[np.float64], offsets: NDArray[np.float64],
    most: float, missing: float,
) -> NDArray[np.float64]:
    """How far points' mirror images are off the field, for each normal and each offset.

    The mean of their squared distances, mm^2, each at most `most`, and `missing` where there is
    nothing.
    """
    costs = np.zeros((len(normals), len(offsets)))
    rows, columns = field.shape[0] - 1, field.shape[1] - 1
    for a in range(len(normals)):
        nx, ny, nz = normals[a]
        for b in range(len(offsets)):
            total = 0.0
            for i in range(len(points)):
                x, y, z = points[i]
                twice = 2 * (nx * x + ny * y + nz * z - offsets[b])
                column = (x - twice * nx - origin[0]) / step
                row = (y - twice * ny - origin[1]) / step
                cost = missing
                if 0 <= row < rows and 0 <= column < columns:
                    near = field[int(row + 0.5), int(column + 0.5)]
                    if near[2] > 0:
                        away = (near[0] + origin[2] - (z - twice * nz)) * near[1]
                        cost = min(away * away, most)
                total += cost
            costs[a, b] = total / len(points)
    return costs


@compiled
def refine_plane(
    field: NDArray[np.float32], origin: NDArray[np.float64], step: float,
    points: NDArray[np.float64], normal: NDArray[np.float64], offset: float, scale: float,
    steps: int, still: float,
) -> tuple[NDArray[np.float64], float, int]:
    """Steps of Gauss and Newton toward the plane that mirrors points onto the field.

    Residuals r, mm along the field's normal, have the weight 1 / (1 + (r / scale)^2)^2; unknown
    are the normal's turn about two axes and the offset's change. It ends when none changes by
    more than `still`, mm and (for points about the origin) a hundredth of it in radians.

    Gives the normal, (3,), the offset, mm, and how many points' images met the field.
    """
    J = np.empty(3)
    rows, columns = field.shape[0] - 1, field.shape[1] - 1
    nx, ny, nz = normal
    met = 0
    for _ in range(steps):
        # Two unit vectors across the normal.
        length = math.sqrt(nx * nx + ny * ny) if abs(nz) < 0.9 else math.sqrt(ny * ny + nz * nz)
        if abs(nz) < 0.9:
            ax, ay, az = ny / length, -nx / length, 0.0
        else:
            ax, ay, az = 0.0, nz / length, -ny / length
        bx, by, bz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
        A, g = np.zeros((3, 3)), np.zeros(3)
        met = 0
        for i in range(len(points)):
            x, y, z = points[i]
            away = nx * x + ny * y + nz * z - offset
            column = (x - 2 * away * nx - origin[0]) / step
            row = (y - 2 * away * ny - origin[1]) / step
            if not (0 <= row < rows and 0 <= column < columns):
                continue
            r, c = int(row), int(column)
            if min(field[r, c, 2], field[r, c + 1, 2],
                   field[r + 1, c, 2], field[r + 1, c + 1, 2]) <= 0:
                continue
            down, right = row - r, column - c
            upper = field[r, c, 0] + right * (field[r, c + 1, 0] - field[r, c, 0])
            lower = field[r + 1, c, 0] + right * (field[r + 1, c + 1, 0] - field[r + 1, c, 0])
            dx = ((1 - down) * (field[r, c + 1, 0] - field[r, c, 0])
                  + down * (field[r + 1, c + 1, 0] - field[r + 1, c, 0])) / step
            dy = (lower - upper) / step
            # The field's normal is (-dx, -dy, 1) facing.
            facing = 1 / math.sqrt(1 + dx * dx + dy * dy)
            rest = (upper + down * (lower - upper) + origin[2] - (z - 2 * away * nz)) * facing
            looks = facing * (nz - dx * nx - dy * ny)
            J[0] = 2 * ((ax * x + ay * y + az * z) * looks
                        + away * facing * (az - dx * ax - dy * ay))
            J[1] = 2 * ((bx * x + by * y + bz * z) * looks
                        + away * facing * (bz - dx * bx - dy * by))
            J[2] = -2 * looks
            weight = 1 / (1 + (rest / scale) ** 2) ** 2
            for j in range(3):
                g[j] -= weight * J[j] * rest
                for k in range(3):
                    A[j, k] += weight * J[j] * J[k]
            met += 1
        moved = _solve(A, g)
        nx, ny, nz = (nx + moved[0] * ax + moved[1] * bx, ny + moved[0] * ay + moved[1] * by,
                      nz + moved[0] * az + moved[1] * bz)
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        nx, ny, nz = nx / length, ny / length, nz / length
        offset += moved[2]
        if max(100 * abs(moved[0]), 100 * abs(moved[1]), abs(moved[2])) < still:
            break
    return np.array([nx, ny, nz]), offset, met


@compiled
def _solve(A: NDArray[np.float64], g: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve three symmetric equations by Cholesky; 0 for what they leave open."""
    L = np.zeros((3, 3))
    x = np.zeros(3)
    for j in range(3):
        left = A[j, j]
        for k in range(j):
            left -= L[j, k] * L[j, k]
        if left <= 1e-9 * A[j, j]:
            return x
        L[j, j] = math.sqrt(left)
        for i in range(j + 1, 3):
            value = A[i, j]
            for k in range(j):
                value -= L[i, k] * L[j, k]
            L[i, j] = value / L[j, j]
    for i in range(3):
        value = g[i]
        for k in range(i):
            value -= L[i, k] * x[k]
        x[i] = value / L[i, i]
    for i in range(2, -1, -1):
        value = x[i]
        for k in range(i + 1, 3):
            value -= L[k, i] * x[k]
        x[i] = value / L[i, i]
    return x


@compiled
def mirror_image(
    field: NDArray[np.float32], added: NDArray[np.float32], origin: NDArray[np.float64],
    step: float, normal: NDArray[np.float64], offset: float, farthest: float, steepest: float,
) -> NDArray[np.float32]:
    """What a field shows at each of its points' mirror images, (k, rows, columns) float32.

    `added` to the heights, (rows, columns) mm, is the surface whose points are mirrored. The
    first plane of the result is how far along the point's own normal the mirrored heights are
    from the heights, mm; the second how far the mirrored surface is from the surface; the third
    the weight of the image, fading to 0 at distances of `farthest` and where the surface there
    looks aside by `steepest`; all others are looked up. Zero where there is nothing.
    """
    rows, columns, kinds = field.shape
    out = np.zeros((kinds, rows, columns), np.float32)
    read = np.empty(kinds, np.float32)
    flat, per_step = field.ravel(), 1 / step
    to_right, to_lower = np.uint64(kinds), np.uint64(columns * kinds)
    for i in range(rows):
        y = origin[1] + step * i
        for j in range(columns):
            if field[i, j, 2] <= 0:
                continue
            x, z = origin[0] + step * j, np.float64(field[i, j, 0] + added[i, j])
            twice = 2 * (normal[0] * x + normal[1] * y + normal[2] * z - offset)
            column = j - twice * normal[0] * per_step
            row = i - twice * normal[1] * per_step
            if not (0 <= row < rows - 1 and 0 <= column < columns - 1):
                continue
            r, c = np.uint64(row), np.uint64(column)
            down, right = np.float32(row - r), np.float32(column - c)
            at = r * to_lower + c * to_right
            for k in range(to_right):
                here = at + k
                upper = flat[here] + right * (flat[here + to_right] - flat[here])
                here += to_lower
                lower = flat[here] + right * (flat[here + to_right] - flat[here])
                read[k] = upper + down * (lower - upper)
            away = (read[0] - np.float32(z - twice * normal[2])) * read[1]
            gap = away + added[i, j] * field[i, j, 1]
            near = min(max(2 - 2 * abs(gap) / farthest, 0.0), 1.0)
            faced = min(max(read[1] / steepest - 1, 0.0), 1.0)
            weight = read[2] * near * faced
            if weight > 0:
                for k in range(kinds):
                    out[k, i, j] = read[k]
                r1, c1 = r + np.uint64(1), c + np.uint64(1)
                upper = added[r, c] + right * (added[r, c1] - added[r, c])
                lower = added[r1, c] + right * (added[r1, c1] - added[r1, c])
                out[0, i, j] = gap
                out[1, i, j] = away + (upper + down * (lower - upper)) * read[1]
                out[2, i, j] = weight
    return out
