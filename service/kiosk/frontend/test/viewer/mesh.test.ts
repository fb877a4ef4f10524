import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { decodeMesh, type Mesh, MeshError, thinnedMesh, toMeshSurface } from "../../src/viewer/mesh.ts";

const CUBE = new Uint8Array(readFileSync(new URL("../vectors/cube.mesh", import.meta.url)));

test("a mesh is read as the service wrote it", () => {
  const cube = decodeMesh(CUBE);
  assert.equal(cube.positions.length, 3 * 8);
  assert.equal(cube.triangles.length, 3 * 12);
  assert.deepEqual([...cube.positions.slice(3, 6)], [10, 0, 700]);
  assert.deepEqual([...cube.tints.slice(4, 8)], [255, 0, 0, 0]);
});

test("its outside is lit: normals point away from its middle, which it turns on", () => {
  const { positions, normals, halfSize, origin } = toMeshSurface(decodeMesh(CUBE));
  assert.deepEqual([...halfSize], [5, 5, 5]);
  assert.deepEqual([...origin], [5, 5, 705]);
  for (let point = 0; point < 8; point++) {
    const outward = [0, 1, 2].reduce(
      (sum, axis) => sum + positions[3 * point + axis]! * normals[4 * point + axis]!, 0);
    assert.ok(outward > 0);
    const length = Math.hypot(...normals.subarray(4 * point, 4 * point + 3));
    assert.ok(Math.abs(length - 32767) < 3);
  }
});

test("what is no mesh, or a damaged one, is refused", () => {
  const changed = (at: number, value: number): Uint8Array<ArrayBuffer> => {
    const copy = CUBE.slice();
    new DataView(copy.buffer).setUint32(at, value, true);
    return copy;
  };
  for (const bytes of [new Uint8Array(0), CUBE.slice(0, 60), changed(0, 1), changed(4, 2),
    changed(8, 2 ** 31), changed(20, 0x7fc00000), changed(20 + 12 * 8, 8)]) {
    assert.throws(() => decodeMesh(bytes), MeshError);
  }
});

test("a cloud is thinned evenly, whatever the order of its points", () => {
  const positions = new Float32Array(3 * 400);
  for (let point = 0; point < 400; point++) {
    const mixed = point * 171 % 400;
    positions.set([mixed % 20, Math.floor(mixed / 20), 500], 3 * point);
  }
  const cloud: Mesh = {
    positions, triangles: new Uint32Array(0), tints: new Uint8Array(4 * 400), stepMm: 1,
  };
  assert.equal(thinnedMesh(cloud, 1).length, 400);
  const few = [...thinnedMesh(cloud, 4)];
  assert.equal(few.length, 25);
  assert.equal(new Set(few.map((point) =>
    `${Math.floor(positions[3 * point]! / 4)} ${Math.floor(positions[3 * point + 1]! / 4)}`)).size, 25);
});
