/** A mesh or a cloud of any kind, as `denseface view` sends it: `service/view/meshes.py`. */

import type { Surface } from "./surface.ts";

/** A mesh in a depth camera's frame: x right, y down, z forward; mm. */
export interface Mesh {
  /** (points * 3): x, y, z, mm. */
  readonly positions: Float32Array;
  /** (triangles * 3): points; none of a cloud. */
  readonly triangles: Uint32Array;
  /** (points * 4): red, green, blue (sRGB), and 0. */
  readonly tints: Uint8Array;
  /** Mean distance of neighbouring points, mm. */
  readonly stepMm: number;
}

/** What was given is no mesh; the message says what is wrong. */
export class MeshError extends Error {
  override readonly name = "MeshError";
}

const MAGIC = 0x534d4644; // "DFMS", read as little-endian
const VERSION = 1;
const PREFIX_BYTES = 20;
const COLORED = 1;
/** What has no colours: sRGB. */
const PLAIN = [186, 182, 178, 0] as const;
const UNIT = 32767;

/** Reads a mesh; throws a MeshError where the bytes are none. */
export function decodeMesh(bytes: Uint8Array<ArrayBuffer>): Mesh {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < PREFIX_BYTES || view.getUint32(0, true) !== MAGIC) {
    throw new MeshError("these bytes are no mesh");
  }
  const [version, points, count, flags] = [4, 8, 12, 16].map((at) => view.getUint32(at, true)) as
    [number, number, number, number];
  if (version !== VERSION) throw new MeshError(`version ${version}, expected ${VERSION}`);
  const colored = (flags & COLORED) !== 0;
  const length = PREFIX_BYTES + 12 * points + 12 * count + (colored ? 3 * points : 0);
  if (bytes.length !== length) throw new MeshError(`${bytes.length} bytes, expected ${length}`);
  let at = PREFIX_BYTES;
  const take = (size: number): Uint8Array<ArrayBuffer> => bytes.slice(at, (at += size));
  const positions = new Float32Array(take(12 * points).buffer);
  const triangles = new Uint32Array(take(12 * count).buffer);
  if (triangles.some((point) => point >= points)) throw new MeshError("a triangle has no such point");
  if (positions.some((value) => !Number.isFinite(value))) throw new MeshError("a point is nowhere");
  const tints = new Uint8Array(4 * points);
  const colors = colored ? take(3 * points) : null;
  for (let point = 0; point < points; point++) {
    tints.set(colors?.subarray(3 * point, 3 * point + 3) ?? PLAIN, 4 * point);
  }
  return { positions, triangles, tints, stepMm: stepOf(positions, triangles) };
}

/** The mean length of edges; of a cloud, what its points would have apart on the front. */
function stepOf(positions: Float32Array, triangles: Uint32Array): number {
  const points = positions.length / 3;
  if (triangles.length === 0) {
    const { halfSize: [width, height] } = extentOf(positions);
    return Math.max(1e-3, Math.sqrt(4 * width * height / Math.max(1, points)));
  }
  let sum = 0;
  for (let corner = 0; corner < triangles.length; corner += 3) {
    const [a, b] = [3 * triangles[corner]!, 3 * triangles[corner + 1]!];
    sum += Math.hypot(positions[a]! - positions[b]!, positions[a + 1]! - positions[b + 1]!,
      positions[a + 2]! - positions[b + 2]!);
  }
  return Math.max(1e-3, sum / (triangles.length / 3));
}

function extentOf(positions: Float32Array): { middle: number[]; halfSize: [number, number, number] } {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let at = 0; at < positions.length; at++) {
    const axis = at % 3;
    if (positions[at]! < low[axis]!) low[axis] = positions[at]!;
    if (positions[at]! > high[axis]!) high[axis] = positions[at]!;
  }
  const half = (axis: number): number => positions.length ? (high[axis]! - low[axis]!) / 2 : 0;
  return {
    middle: [0, 1, 2].map((axis) => positions.length ? (low[axis]! + high[axis]!) / 2 : 0),
    halfSize: [half(0), half(1), half(2)],
  };
}

/** Makes the vertices of a mesh, which turns about its middle. */
export function toMeshSurface({ positions: given, triangles }: Mesh): Surface {
  const { middle: [x, y, z], halfSize } = extentOf(given);
  const origin = [x!, y!, z!] as const;
  const positions = new Float32Array(given.length);
  for (let at = 0; at < given.length; at += 3) {
    positions[at] = given[at]! - origin[0];
    positions[at + 1] = origin[1] - given[at + 1]!;
    positions[at + 2] = origin[2] - given[at + 2]!;
  }
  return { positions, normals: normalsOf(positions, triangles), origin, halfSize };
}

/** Normals of points: of their triangles, each by its area; toward the viewer where there are none. */
function normalsOf(positions: Float32Array, triangles: Uint32Array): Int16Array {
  const sums = new Float32Array(positions.length);
  const side = (from: number, to: number): [number, number, number] => [
    positions[to]! - positions[from]!, positions[to + 1]! - positions[from + 1]!,
    positions[to + 2]! - positions[from + 2]!];
  for (let at = 0; at < triangles.length; at += 3) {
    const corners = [3 * triangles[at]!, 3 * triangles[at + 1]!, 3 * triangles[at + 2]!] as const;
    const [ax, ay, az] = side(corners[0], corners[1]);
    const [bx, by, bz] = side(corners[0], corners[2]);
    const normal = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx];
    for (const corner of corners) {
      for (let axis = 0; axis < 3; axis++) sums[corner + axis]! += normal[axis]!;
    }
  }
  const normals = new Int16Array(positions.length / 3 * 4);
  for (let point = 0; point < normals.length / 4; point++) {
    const [x, y, z] = [sums[3 * point]!, sums[3 * point + 1]!, sums[3 * point + 2]!];
    const length = Math.hypot(x, y, z);
    normals[4 * point] = length ? UNIT * x / length : 0;
    normals[4 * point + 1] = length ? UNIT * y / length : 0;
    normals[4 * point + 2] = length ? UNIT * z / length : UNIT;
    normals[4 * point + 3] = UNIT; // no rim is faded
  }
  return normals;
}

/** A point of each cube whose sides are `stride` steps: as far apart everywhere, in any order. */
export function thinnedMesh({ positions, stepMm }: Mesh, stride: number): Uint32Array {
  const points = positions.length / 3;
  if (stride === 1) return Uint32Array.from({ length: points }, (_, point) => point);
  const { middle, halfSize } = extentOf(positions);
  const side = stride * stepMm;
  const cube = (point: number, axis: number): number =>
    Math.floor((positions[3 * point + axis]! - middle[axis]! + halfSize[axis]!) / side);
  const [across, down] = [0, 1].map((axis) => Math.floor(2 * halfSize[axis]! / side) + 1) as
    [number, number];
  const taken = new Set<number>();
  const out = new Uint32Array(points);
  for (let point = 0; point < points; point++) {
    const place = cube(point, 0) + across * (cube(point, 1) + down * cube(point, 2));
    if (taken.has(place)) continue;
    out[taken.size] = point;
    taken.add(place);
  }
  return out.slice(0, taken.size);
}
