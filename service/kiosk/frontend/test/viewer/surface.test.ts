import assert from "node:assert/strict";
import { test } from "node:test";

import type { FaceGrid } from "../../src/face_grid.ts";
import { thinned, toSurface, triangulate } from "../../src/viewer/surface.ts";

const STEP = 0.5;

/** A face whose depth at (row, column) is a function; null where there is no point. */
function grid(rows: number, columns: number, at: (r: number, c: number) => number | null): FaceGrid {
  const index = new Int32Array(rows * columns).fill(-1);
  const places: number[] = [];
  const z: number[] = [];
  for (let place = 0; place < rows * columns; place++) {
    const depth = at(Math.floor(place / columns), place % columns);
    if (depth === null) continue;
    index[place] = z.length;
    places.push(place);
    z.push(depth);
  }
  return {
    rows, columns, index, places: Uint32Array.from(places), z: Float32Array.from(z),
    points: z.length, colors: new Uint8Array(4 * z.length), sigmaMm: [0.5, 4], leftMm: 10,
    topMm: 20, stepMm: STEP, spacingMm: 1.5,
    seeds: { points: 0, positions: new Float32Array(0), colors: new Uint8Array(0) },
  };
}

const flat = (rows: number, columns: number): FaceGrid => grid(rows, columns, () => 700);

test("a whole grid is two triangles for each block, all toward the viewer", () => {
  const face = flat(4, 5);
  const triangles = triangulate(face);
  assert.equal(triangles.length, 3 * 2 * 3 * 4);
  const { positions } = toSurface(face);
  const at = (point: number) => positions.subarray(3 * point, 3 * point + 3);
  for (let n = 0; n < triangles.length; n += 3) {
    const [a, b, c] = [at(triangles[n]!), at(triangles[n + 1]!), at(triangles[n + 2]!)];
    const z = (b[0]! - a[0]!) * (c[1]! - a[1]!) - (b[1]! - a[1]!) * (c[0]! - a[0]!);
    assert.ok(z > 0);
  }
});

test("a block with three points is one triangle, one with fewer none", () => {
  for (const missing of [0, 1, 2, 3]) {
    const block = grid(2, 2, (r, c) => (2 * r + c === missing ? null : 700));
    assert.equal(triangulate(block).length, 3);
  }
  assert.equal(triangulate(grid(2, 2, (r, c) => (r === c ? 700 : null))).length, 0);
});

test("nothing spans a hole or a step in depth", () => {
  const holed = grid(9, 9, (r, c) => (r === 4 && c === 4 ? null : 700));
  assert.equal(triangulate(holed).length, 3 * (2 * 64 - 4));
  // A slope of 14, as beside a nose, makes that along a diagonal; 20 steps are the most.
  for (const [steps, columns] of [[19, 5], [21, 4]] as const) {
    const stepped = grid(3, 6, (_, c) => (c < 3 ? 700 : 700 + steps * STEP));
    assert.equal(triangulate(stepped).length, 3 * 2 * 2 * columns);
  }
});

test("coarser triangles join every second point", () => {
  const face = flat(7, 9);
  const triangles = triangulate(face, 2);
  assert.equal(triangles.length, 3 * 2 * 3 * 4);
  for (const point of triangles) {
    assert.equal(Math.floor(face.places[point]! / 9) % 2, 0);
    assert.equal(face.places[point]! % 9 % 2, 0);
  }
});

test("grids of one row, one column or no point have no triangle", () => {
  for (const face of [flat(1, 9), flat(9, 1), flat(1, 1), grid(3, 3, () => null)]) {
    assert.equal(triangulate(face).length, 0);
    assert.ok(toSurface(face).halfSize.every(Number.isFinite));
  }
});

test("y is up, z toward the viewer, the middle is the origin", () => {
  const face = grid(3, 5, (r, c) => 700 + r + c);
  const { positions, origin, halfSize } = toSurface(face);
  assert.deepEqual(Array.from(halfSize), [2 * STEP, STEP, 3]);
  assert.deepEqual(origin.slice(0, 2), [10 + 2 * STEP, 20 + STEP]);
  assert.deepEqual(Array.from(positions.subarray(0, 2)), [-2 * STEP, STEP]);
  assert.ok(positions[2]! > positions[3 * 14 + 2]!);
});

test("normals are those of the plane, at the rim and beside a hole too", () => {
  const [alongX, alongY] = [0.6, -0.3];
  const face = grid(8, 8, (r, c) =>
    (r === 3 && c === 4 ? null : 700 + STEP * (alongX * c + alongY * r)));
  const { normals } = toSurface(face);
  const length = Math.hypot(alongX, alongY, 1);
  for (let point = 0; point < face.points; point++) {
    [alongX / length, -alongY / length, 1 / length].forEach((wanted, axis) => {
      assert.ok(Math.abs(normals[4 * point + axis]! / 32767 - wanted) < 1e-3);
    });
  }
});

test("the rim fades out at the outline and around holes, evenly in all directions", () => {
  const face = grid(41, 41, (r, c) => (r === 20 && c === 20 ? null : 700));
  const { normals } = toSurface(face);
  const rim = (row: number, column: number) => normals[4 * face.index[41 * row + column]! + 3]!;
  assert.ok(0 < rim(0, 9) && rim(0, 9) < rim(1, 9) && rim(1, 9) < rim(2, 9));
  for (const [row, column] of [[9, 0], [9, 40], [40, 9], [0, 0], [40, 40]] as const) {
    assert.equal(rim(row, column), rim(0, 9));
  }
  assert.ok(rim(20, 19) < rim(20, 18));
  assert.equal(rim(20, 19), rim(21, 20));
  assert.ok(rim(19, 19) > rim(20, 19) && rim(19, 19) < rim(18, 20));
  assert.equal(rim(10, 10), 32767);
});

test("thinned are the points of every so many-th row and column", () => {
  const face = flat(7, 7);
  assert.deepEqual(Array.from(thinned(face, 3)), [0, 3, 6, 21, 24, 27, 42, 45, 48]);
  assert.equal(thinned(face, 1).length, 49);
});
