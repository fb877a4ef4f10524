"""A height field's mirror image in a plane, compiled.

A plane is a unit normal and an offset, mm: n . p = offset. A point looks along z by the cosine of
its normal to the z axis, its *facing*.
"""

import math
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles, Floats
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

Vector = tuple[float, float, float]


class HeightField(NamedTuple):
    """A face's surface over (X, Y), on a regular grid.

    planes : (rows, columns, k) float32: height, mm; facing; weight as a mirror image, 0-1; and for
        `mirror_image` besides: detail, mm along the normal; weight of the seeds, 0-1
    origin : (3,) float64, mm, x and y of the first point, and what is added to the heights
    step : distance of the points, mm
    """

    planes: Floats
    origin: Doubles
    step: float


@compiled
def sample_points(field: HeightField, every: int, min_facing: float) -> Doubles:
    """Give every so many of a field's points, (n, 3) mm, that count and face the camera."""
    planes, origin, step = field
    rows, columns = planes.shape[:2]
    points = np.empty(((rows // every + 1) * (columns // every + 1), 3))
    count = 0
    for i in range(0, rows, every):
        for j in range(0, columns, every):
            if planes[i, j, 2] > 0 and planes[i, j, 1] > min_facing:
                points[count, 0] = origin[0] + step * j
                points[count, 1] = origin[1] + step * i
                points[count, 2] = planes[i, j, 0]
                count += 1
    return points[:count].copy()


@compiled
def principal_curvature_angle(points: Doubles) -> float:
    """Give the direction, from x toward y, rad, in which points curve away from the camera most.

    points : (n, 3), mm, about their mean; a quadric is fitted to them
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
    # The axis of the Hessian's larger eigenvalue.
    return math.atan2(2 * fit[4], fit[3] - fit[5]) / 2


@compiled
def mirror_costs(
    field: HeightField, points: Doubles, normals: Doubles, offsets: Doubles, limit: float,
    missing: float,
) -> Doubles:
    """Give the mean squared distance of points' mirror images from the field, mm^2.

    points : (n, 3), normals : (a, 3), offsets : (b,)
    limit, missing : mm^2, the largest cost of a point, and its cost where the field has no weight

    Gives (a, b).
    """
    planes, origin, step = field
    costs = np.zeros((len(normals), len(offsets)))
    rows, columns = planes.shape[0] - 1, planes.shape[1] - 1
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
                    r, c = np.uint64(row + 0.5), np.uint64(column + 0.5)
                    if planes[r, c, 2] > 0:
                        away = (planes[r, c, 0] + origin[2] - (z - twice * nz)) * planes[r, c, 1]
                        cost = min(away * away, limit)
                total += cost
            costs[a, b] = total / len(points)
    return costs


@compiled
def refine_plane(
    field: HeightField, points: Doubles, normal: Doubles, offset: float, scale: float, steps: int,
    tolerance: float,
) -> tuple[Doubles, float, int]:
    """Take Gauss-Newton steps toward the plane that mirrors points onto the field.

    Unknown are the normal's turn about two axes, rad, and the offset's change, mm. Ends when none
    changes by more than `tolerance`, mm, of turns a hundredth of it.

    points : (n, 3) mm, about the origin
    scale : mm, of the residuals' weights (Geman and McClure, 1987)

    Gives the normal, (3,), the offset, mm, and how many points' images met the field.
    """
    normal, met = normal.copy(), 0
    for _ in range(steps):
        a, b = _tangents(normal)
        matrix, right, met = _normal_equations(field, points, normal, offset, a, b, scale)
        moved = solve_small(matrix, right)
        for k in range(3):
            normal[k] += moved[0] * a[k] + moved[1] * b[k]
        normal /= math.sqrt(
            normal[0] * normal[0] + normal[1] * normal[1] + normal[2] * normal[2])
        offset += moved[2]
        if max(100 * abs(moved[0]), 100 * abs(moved[1]), abs(moved[2])) < tolerance:
            break
    return normal, offset, met


@compiled
def _tangents(normal: Doubles) -> tuple[Vector, Vector]:
    """Give two unit vectors that span the plane."""
    nx, ny, nz = normal
    if abs(nz) < 0.9:
        length = math.sqrt(nx * nx + ny * ny)
        a = ny / length, -nx / length, 0.0
    else:
        length = math.sqrt(ny * ny + nz * nz)
        a = 0.0, nz / length, -ny / length
    return a, (ny * a[2] - nz * a[1], nz * a[0] - nx * a[2], nx * a[1] - ny * a[0])


@compiled
def _normal_equations(
    field: HeightField, points: Doubles, normal: Doubles, offset: float, a: Vector, b: Vector,
    scale: float,
) -> tuple[Doubles, Doubles, int]:
    """Sum the weighted normal equations of `refine_plane`, and count the images that met.

    Residuals r, mm along the field's normal, have the weight 1 / (1 + (r / scale)^2)^2.
    """
    planes, origin, step = field
    A, g, J = np.zeros((3, 3)), np.zeros(3), np.empty(3)
    rows, columns = planes.shape[0] - 1, planes.shape[1] - 1
    nx, ny, nz = normal
    ax, ay, az = a
    bx, by, bz = b
    met = 0
    for i in range(len(points)):
        x, y, z = points[i]
        away = nx * x + ny * y + nz * z - offset
        column = (x - 2 * away * nx - origin[0]) / step
        row = (y - 2 * away * ny - origin[1]) / step
        if not (0 <= row < rows and 0 <= column < columns):
            continue
        r, c = int(row), int(column)
        if min(planes[r, c, 2], planes[r, c + 1, 2],
               planes[r + 1, c, 2], planes[r + 1, c + 1, 2]) <= 0:
            continue
        down, right = row - r, column - c
        upper = planes[r, c, 0] + right * (planes[r, c + 1, 0] - planes[r, c, 0])
        lower = planes[r + 1, c, 0] + right * (planes[r + 1, c + 1, 0] - planes[r + 1, c, 0])
        dx = ((1 - down) * (planes[r, c + 1, 0] - planes[r, c, 0])
              + down * (planes[r + 1, c + 1, 0] - planes[r + 1, c, 0])) / step
        dy = (lower - upper) / step
        # The field's normal is (-dx, -dy, 1) facing.
        facing = 1 / math.sqrt(1 + dx * dx + dy * dy)
        rest = (upper + down * (lower - upper) + origin[2] - (z - 2 * away * nz)) * facing
        cosine = facing * (nz - dx * nx - dy * ny)
        J[0] = 2 * ((ax * x + ay * y + az * z) * cosine
                    + away * facing * (az - dx * ax - dy * ay))
        J[1] = 2 * ((bx * x + by * y + bz * z) * cosine
                    + away * facing * (bz - dx * bx - dy * by))
        J[2] = -2 * cosine
        weight = 1 / (1 + (rest / scale) ** 2) ** 2
        for j in range(3):
            g[j] -= weight * J[j] * rest
            for k in range(3):
                A[j, k] += weight * J[j] * J[k]
        met += 1
    return A, g, met


@compiled
def mirror_image(
    field: HeightField, added: Floats, normal: Doubles, offset: float, max_distance: float,
    min_facing: float,
) -> Floats:
    """Sample a field at the mirror image of each of its points, (k, rows, columns) float32.

    added : (rows, columns), mm, added to the heights: of that surface the points are mirrored
    max_distance : mm, at which the weight of an image has faded to 0
    min_facing : below which it has, too

    Planes of the result: how far along the point's own normal the mirrored heights are from the
    heights, mm; how far the mirrored surface is from the surface, mm; the weight of the image; the
    field's other planes, bilinear. Zero where there is nothing.
    """
    planes, origin, step = field
    rows, columns, kinds = planes.shape
    out = np.zeros((kinds, rows, columns), np.float32)
    read = np.empty(kinds, np.float32)
    flat, per_step = planes.ravel(), 1 / step
    to_right, to_lower = np.uint64(kinds), np.uint64(columns * kinds)
    for i in range(rows):
        y = origin[1] + step * i
        for j in range(columns):
            if planes[i, j, 2] <= 0:
                continue
            x, z = origin[0] + step * j, np.float64(planes[i, j, 0] + added[i, j])
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
            gap = away + added[i, j] * planes[i, j, 1]
            near = min(max(2 - 2 * abs(gap) / max_distance, 0.0), 1.0)
            faced = min(max(read[1] / min_facing - 1, 0.0), 1.0)
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
