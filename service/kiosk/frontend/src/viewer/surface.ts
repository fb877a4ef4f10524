/** A face's grid as vertices and triangles, in the frame in which it is looked at. */

import type { FaceGrid } from "../face_grid.ts";

/** What is drawn: x right, y up, z toward the viewer, mm, about the point that the face turns on. */
export interface Surface {
  /** (points * 3): x, y, z, mm. */
  readonly positions: Float32Array;
  /** (points * 4): the unit normal, times 32767, and the distance to the rim: `RIM_STEPS` and more
   * are 32767. */
  readonly normals: Int16Array;
  /** What of the grid's frame is the origin: x right, y down, z forward, mm. */
  readonly origin: readonly [number, number, number];
  /** Half of the width, height and depth, mm. */
  readonly halfSize: readonly [number, number, number];
}

/** Steps of the grid over which the rim is faded, which hides its stairs. */
export const RIM_STEPS = 8;
/** Largest step in depth between neighbours, in grid steps: more is a gap between two surfaces. The
 * files that the service writes have the same limit. */
const MAX_STEP = 20;
/** How far behind the middle of the face's depth it turns on, as a part of that depth. */
const PIVOT_BEHIND = 0.15;
const UNIT = 32767;

/** Makes the vertices of a face. */
export function toSurface(face: FaceGrid): Surface {
  const { columns, places, z, leftMm, topMm, stepMm, points } = face;
  let [left, right, top, bottom, near, far] = [Infinity, -Infinity, Infinity, -Infinity, Infinity,
    -Infinity];
  for (let point = 0; point < points; point++) {
    const row = Math.floor(places[point]! / columns);
    const column = places[point]! - row * columns;
    if (column < left) left = column;
    if (column > right) right = column;
    if (row < top) top = row;
    if (row > bottom) bottom = row;
    if (z[point]! < near) near = z[point]!;
    if (z[point]! > far) far = z[point]!;
  }
  if (points === 0) [left, right, top, bottom, near, far] = [0, 0, 0, 0, 0, 0];
  const originX = leftMm + (left + right) / 2 * stepMm;
  const originY = topMm + (top + bottom) / 2 * stepMm;
  const originZ = (near + far) / 2 + PIVOT_BEHIND * (far - near);
  const positions = new Float32Array(3 * points);
  for (let point = 0; point < points; point++) {
    const row = Math.floor(places[point]! / columns);
    const column = places[point]! - row * columns;
    positions[3 * point] = leftMm + column * stepMm - originX;
    positions[3 * point + 1] = originY - (topMm + row * stepMm);
    positions[3 * point + 2] = originZ - z[point]!;
  }
  return {
    positions, normals: toNormals(face),
    origin: [originX, originY, originZ],
    halfSize: [(right - left) / 2 * stepMm, (bottom - top) / 2 * stepMm, (far - near) / 2],
  };
}

/** Normals by differences over three rows and columns, which evens out the rounding of depths. */
function toNormals(face: FaceGrid): Int16Array {
  const { rows, columns, index, places, z, stepMm, points } = face;
  const normals = new Int16Array(4 * points);
  const rim = toRim(face);
  const limit = 2 * MAX_STEP * stepMm;
  /** The slope along `along`, averaged over the lines that lie `across`, in mm for each step. */
  const slope = (
    point: number, place: number, along: number, before: boolean, after: boolean, across: number,
    first: number, last: number,
  ): number => {
    let sum = 0;
    let weights = 0;
    if (before && after) {
      for (let line = first; line <= last; line++) {
        const a = index[place + line * across - along]!;
        const b = index[place + line * across + along]!;
        if (a < 0 || b < 0) continue;
        const step = z[b]! - z[a]!;
        if (step > limit || step < -limit) continue;
        const weight = line === 0 ? 2 : 1;
        sum += weight * step;
        weights += weight;
      }
      if (weights > 0) return sum / (2 * weights);
    }
    const a = before ? index[place - along]! : -1;
    const b = after ? index[place + along]! : -1;
    if (b >= 0 && Math.abs(z[b]! - z[point]!) <= limit) return z[b]! - z[point]!;
    if (a >= 0 && Math.abs(z[point]! - z[a]!) <= limit) return z[point]! - z[a]!;
    return 0;
  };
  for (let point = 0; point < points; point++) {
    const place = places[point]!;
    const row = Math.floor(place / columns);
    const column = place - row * columns;
    const [west, east] = [column > 0, column < columns - 1];
    const [north, south] = [row > 0, row < rows - 1];
    const dx = slope(point, place, 1, west, east, columns, north ? -1 : 0, south ? 1 : 0);
    const dy = slope(point, place, columns, north, south, 1, west ? -1 : 0, east ? 1 : 0);
    // The surface z(x, y) of the camera's frame, y and z turned round: (dz/dx, -dz/dy, 1).
    const scale = UNIT / Math.sqrt(dx * dx + dy * dy + stepMm * stepMm);
    normals[4 * point] = dx * scale;
    normals[4 * point + 1] = -dy * scale;
    normals[4 * point + 2] = stepMm * scale;
    normals[4 * point + 3] = rim[place]! / (3 * RIM_STEPS) * UNIT;
  }
  return normals;
}

/** How far each place is from one without a point, thirds of a step, at most 3 `RIM_STEPS`: a
 * chamfer distance (G. Borgefors, 1986), 3 to the side and 4 across a corner. */
function toRim({ rows, columns, index }: FaceGrid): Uint8Array {
  const rim = new Uint8Array(rows * columns);
  const most = 3 * RIM_STEPS;
  /** The distance by way of neighbours already known: those in the row before, and beside. */
  const byWayOf = (place: number, column: number, row: number, beside: number): number => {
    const west = column > 0;
    const east = column < columns - 1;
    const known = (beside < 0 ? place >= columns : place + columns < rim.length);
    return Math.min(
      (beside < 0 ? west : east) ? rim[place + beside]! + 3 : 3,
      known ? rim[place + row]! + 3 : 3,
      known && west ? rim[place + row - 1]! + 4 : 4,
      known && east ? rim[place + row + 1]! + 4 : 4);
  };
  for (let place = 0; place < rim.length; place++) {
    if (index[place]! >= 0) rim[place] = Math.min(most, byWayOf(place, place % columns, -columns, -1));
  }
  for (let place = rim.length - 1; place >= 0; place--) {
    if (index[place]! < 0) continue;
    rim[place] = Math.min(rim[place]!, byWayOf(place, place % columns, columns, 1));
  }
  return rim;
}

/**
 * Joins neighbouring points by triangles, the front toward the viewer.
 *
 * @param stride 1 for every point, 2 for those of every second row and column, and so on.
 * @returns three points for each triangle. A block of four places with three points gives one
 * triangle; triangles that span more than `MAX_STEP` grid steps in depth are left out.
 */
export function triangulate(face: FaceGrid, stride = 1): Uint32Array {
  const { rows, columns, index, z, stepMm } = face;
  const limit = MAX_STEP * stride * stepMm;
  const most = 6 * Math.floor((rows - 1) / stride) * Math.floor((columns - 1) / stride);
  const out = new Uint32Array(Math.max(0, most));
  let n = 0;
  const join = (a: number, b: number, c: number): void => {
    const [p, q, r] = [z[a]!, z[b]!, z[c]!];
    if (Math.max(p, q, r) - Math.min(p, q, r) > limit) return;
    out[n++] = a;
    out[n++] = b;
    out[n++] = c;
  };
  for (let row = 0; row + stride < rows; row += stride) {
    for (let column = 0; column + stride < columns; column += stride) {
      const place = row * columns + column;
      const a = index[place]!;
      const b = index[place + stride]!;
      const c = index[place + stride * columns]!;
      const d = index[place + stride * columns + stride]!;
      if (a >= 0 && d >= 0) {
        if (c >= 0) join(a, c, d);
        if (b >= 0) join(a, d, b);
      } else if (b >= 0 && c >= 0) {
        if (a >= 0) join(a, c, b);
        if (d >= 0) join(b, c, d);
      }
    }
  }
  return out.slice(0, n);
}

/** The points of every `stride`-th row and column. */
export function thinned({ columns, places }: FaceGrid, stride: number): Uint32Array {
  const out = new Uint32Array(places.length);
  let n = 0;
  for (let point = 0; point < places.length; point++) {
    const row = Math.floor(places[point]! / columns);
    if (row % stride === 0 && (places[point]! - row * columns) % stride === 0) out[n++] = point;
  }
  return out.slice(0, n);
}
