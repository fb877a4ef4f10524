"""Point-to-plane equations of a model before a field of heights, and its drawing, compiled.

Points of the model meet the height at their own (x, y). The residual is how far the model lies
behind the heights along their normal (Chen and Medioni, 1992, doi:10.1016/0262-8856(92)90066-C).
"""

import math
from typing import NamedTuple

import numpy as np

from denseface.recon.arrays import Doubles, Floats, Ints
from denseface.recon.numerics.jit import compiled
from denseface.recon.numerics.linear_solve import solve_small

_TURNED_AWAY = -0.2
"""A point of the model whose normal's z is above it is not seen."""
_DAMPING = 1e-3
"""Of a step of the pose: part of what holds its shift along z."""


class Heights(NamedTuple):
    """A surface over (X, Y), on a regular grid.

    heights : (rows, columns) float32, mm
    weights : (rows, columns) float32, 0-1: how much of a height is measured; 0 where none is
    origin : (x, y) of the first point, mm
    step : distance of the points, mm
    """

    heights: Floats
    weights: Floats
    origin: tuple[float, float]
    step: float


@compiled
def meet(
    field: Heights, x: float, y: float, z: float
) -> tuple[float, float, float, float, float]:
    """Give how far a point is behind the heights along their normal, mm, the normal, the weight.

    The weight is 0 off the grid, and where one of the four heights around was not measured.
    """
    heights, weights, origin, step = field
    column, row = (x - origin[0]) / step, (y - origin[1]) / step
    if not (1 <= row < heights.shape[0] - 2 and 1 <= column < heights.shape[1] - 2):
        return 0.0, 0.0, 0.0, 0.0, 0.0
    r, c = int(row), int(column)
    weight = min(weights[r, c], weights[r, c + 1], weights[r + 1, c], weights[r + 1, c + 1])
    if weight <= 0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    down, right = row - r, column - c
    upper = heights[r, c] + right * (heights[r, c + 1] - heights[r, c])
    lower = heights[r + 1, c] + right * (heights[r + 1, c + 1] - heights[r + 1, c])
    dx = ((1 - down) * (heights[r, c + 1] - heights[r, c])
          + down * (heights[r + 1, c + 1] - heights[r + 1, c])) / step
    dy = (lower - upper) / step
    facing = 1 / math.sqrt(1 + dx * dx + dy * dy)
    behind = (z - upper - down * (lower - upper)) * facing
    return behind, -dx * facing, -dy * facing, facing, weight


@compiled
def best_pose(
    field: Heights, points: Floats, normals: Floats, rotations: Doubles, shifts: Doubles,
    scales: Doubles, limit: float, missing: float,
) -> int:
    """Take Gauss-Newton steps from each pose of a stiff face, in place; give the best's index.

    points, normals : (n, 3), in the model's frame
    rotations, shifts : (s, 3, 3) and (s, 3) mm, to the heights' frame; z of the shifts is found
    scales : (steps,) mm, of the weights 1 / (1 + (r / scale)^2)^2 (Geman and McClure, 1987)
    limit, missing : mm^2, when poses are compared: the largest cost of a point, and that of one
        that meets nothing
    """
    best, least = 0, 1e30
    for start in range(len(rotations)):
        rotation, shift = rotations[start], shifts[start]
        _meet_middle(field, points, normals, rotation, shift)
        for scale in scales:
            _rigid_step(field, points, normals, rotation, shift, scale)
        cost = _cost(field, points, normals, rotation, shift, limit, missing)
        if cost < least:
            best, least = start, cost
    return best


@compiled
def _meet_middle(
    field: Heights, points: Floats, normals: Floats, rotation: Doubles, shift: Doubles
) -> None:
    """Move a face along z until it is as far before the heights as behind them."""
    at = np.empty(3)
    behind, met = 0.0, 0.0
    for i in range(len(points)):
        _turn(rotation, points[i], at)
        rest, _, _, nz, weight = meet(
            field, at[0] + shift[0], at[1] + shift[1], at[2] + shift[2])
        if weight > 0 and _turned_z(rotation, normals[i]) <= _TURNED_AWAY:
            behind += weight * rest / nz
            met += weight
    shift[2] -= behind / max(met, 1e-6)


@compiled
def _rigid_step(
    field: Heights, points: Floats, normals: Floats, rotation: Doubles, shift: Doubles,
    scale: float,
) -> None:
    at, J, A, g = np.empty(3), np.empty(6), np.zeros((6, 6)), np.zeros(6)
    for i in range(len(points)):
        if _turned_z(rotation, normals[i]) > _TURNED_AWAY:
            continue
        _turn(rotation, points[i], at)
        rest, nx, ny, nz, weight = meet(
            field, at[0] + shift[0], at[1] + shift[1], at[2] + shift[2])
        if weight <= 0:
            continue
        weight /= (1 + (rest / scale) ** 2) ** 2
        _pose_gradient(at, nx, ny, nz, J)
        for j in range(6):
            g[j] -= weight * J[j] * rest
            for k in range(6):
                A[j, k] += weight * J[j] * J[k]
    for j in range(6):
        A[j, j] += _DAMPING * (A[5, 5] + 1)
    moved = solve_small(A, g)
    _turn_by(rotation, moved)
    for j in range(3):
        shift[j] += moved[3 + j]


@compiled
def _cost(
    field: Heights, points: Floats, normals: Floats, rotation: Doubles, shift: Doubles,
    limit: float, missing: float,
) -> float:
    at = np.empty(3)
    total, seen = 0.0, 0
    for i in range(len(points)):
        if _turned_z(rotation, normals[i]) > _TURNED_AWAY:
            continue
        _turn(rotation, points[i], at)
        rest, _, _, _, weight = meet(field, at[0] + shift[0], at[1] + shift[1], at[2] + shift[2])
        seen += 1
        total += min(rest * rest, limit) if weight > 0 else missing
    return total / max(seen, 1)


@compiled
def equations(
    field: Heights, points: Floats, normals: Floats, modes: Floats, rotation: Doubles,
    shift: Doubles, scale: float, J: Floats, rests: Floats, weights: Floats,
) -> tuple[int, int]:
    """Write the equations of pose and modes, one row for each point that meets a height.

    points, normals : (n, 3); modes : (n, 3, k) mm; all in the model's frame
    scale : mm, of the weights as in `best_pose`
    J : (n, 6 + k), of how far behind a point is by turns, rad, shifts, mm, weights of modes
    rests, weights : (n,), how far behind it is, mm; its weight

    Gives how many rows were written, and how many points are turned to the camera.
    """
    at, back = np.empty(3), np.empty(3)
    count, seen = 0, 0
    for i in range(len(points)):
        if _turned_z(rotation, normals[i]) > _TURNED_AWAY:
            continue
        seen += 1
        _turn(rotation, points[i], at)
        rest, nx, ny, nz, weight = meet(
            field, at[0] + shift[0], at[1] + shift[1], at[2] + shift[2])
        if weight <= 0:
            continue
        _pose_gradient(at, nx, ny, nz, J[count])
        _mode_gradient(rotation, nx, ny, nz, modes[i], back, J[count])
        rests[count] = rest
        weights[count] = weight / (1 + (rest / scale) ** 2) ** 2
        count += 1
    return count, seen


@compiled
def draw(
    points: Floats, triangles: Ints, origin: tuple[float, float], step: float, heights: Floats
) -> None:
    """Draw a mesh as the camera's side sees it.

    points : (n, 3) mm, in the heights' frame
    triangles : (m, 3), clockwise where they face the camera
    heights : (rows, columns), mm, changed where the mesh is nearer
    """
    rows, columns = heights.shape
    flat, placed = heights.ravel(), np.empty((len(points), 2))
    for i in range(len(points)):
        for axis in range(2):
            placed[i, axis] = (points[i, axis] - origin[axis]) / step
    for t in range(len(triangles)):
        a, b, c = triangles[t]
        ax, ay = placed[a]
        bx, by = placed[b]
        cx, cy = placed[c]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area >= -1e-9:
            continue
        per_area = 1 / area
        top, bottom = max(0, math.ceil(min(ay, by, cy))), min(rows - 1, int(max(ay, by, cy)))
        left, right = max(0, math.ceil(min(ax, bx, cx))), min(columns - 1, int(max(ax, bx, cx)))
        b_right, b_down = (cy - ay) * per_area, (ax - cx) * per_area
        c_right, c_down = (ay - by) * per_area, (bx - ax) * per_area
        z = points[a, 2]
        to_b, to_c = points[b, 2] - z, points[c, 2] - z
        for i in range(top, bottom + 1):
            of_b = (i - ay) * b_down + (left - ax) * b_right
            of_c = (i - ay) * c_down + (left - ax) * c_right
            for at in range(np.uint64(i * columns + left), np.uint64(i * columns + right + 1)):
                # A little beyond the edges: no point falls between two triangles.
                if of_b >= -1e-9 and of_c >= -1e-9 and of_b + of_c <= 1 + 1e-9:
                    flat[at] = min(flat[at], np.float32(z + of_b * to_b + of_c * to_c))
                of_b += b_right
                of_c += c_right


@compiled
def _turn(rotation: Doubles, point: Floats, out: Doubles) -> None:
    for k in range(3):
        out[k] = (rotation[k, 0] * point[0] + rotation[k, 1] * point[1]
                  + rotation[k, 2] * point[2])


@compiled
def _turned_z(rotation: Doubles, normal: Floats) -> float:
    return float(rotation[2, 0] * normal[0] + rotation[2, 1] * normal[1]
                 + rotation[2, 2] * normal[2])


@compiled
def _pose_gradient(at: Doubles, nx: float, ny: float, nz: float, J: Doubles) -> None:
    """Write (at x n, n) to the first six."""
    J[0] = at[1] * nz - at[2] * ny
    J[1] = at[2] * nx - at[0] * nz
    J[2] = at[0] * ny - at[1] * nx
    J[3], J[4], J[5] = nx, ny, nz


@compiled
def _mode_gradient(
    rotation: Doubles, nx: float, ny: float, nz: float, modes: Floats, back: Doubles, J: Floats
) -> None:
    """Write the modes, (3, k), along a normal of the heights' frame, to the seventh and on."""
    for k in range(3):
        back[k] = rotation[0, k] * nx + rotation[1, k] * ny + rotation[2, k] * nz
    one, two, three = np.float32(back[0]), np.float32(back[1]), np.float32(back[2])
    for k in range(modes.shape[1]):
        J[6 + k] = one * modes[0, k] + two * modes[1, k] + three * modes[2, k]


@compiled
def _turn_by(rotation: Doubles, turn: Doubles) -> None:
    """Turn by a small vector, rad, in place (Rodrigues)."""
    angle = math.sqrt(turn[0] ** 2 + turn[1] ** 2 + turn[2] ** 2)
    if angle < 1e-12:
        return
    x, y, z = turn[0] / angle, turn[1] / angle, turn[2] / angle
    s, c = math.sin(angle), math.cos(angle)
    for k in range(3):
        vx, vy, vz = rotation[0, k], rotation[1, k], rotation[2, k]
        along = (x * vx + y * vy + z * vz) * (1 - c)
        rotation[0, k] = c * vx + s * (y * vz - z * vy) + along * x
        rotation[1, k] = c * vy + s * (z * vx - x * vz) + along * y
        rotation[2, k] = c * vz + s * (x * vy - y * vx) + along * z
