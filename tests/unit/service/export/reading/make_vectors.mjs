// Makes meshopt_vectors.json, by meshoptimizer's own encoder. Arguments: the folder of the packages,
// and where to write.
import { writeFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [packages, output] = process.argv.slice(2);
const load = (name) => import(pathToFileURL(`${packages}/${name}`).href);
const { MeshoptEncoder } = await load("meshoptimizer/meshopt_encoder.js");
const { MeshoptDecoder } = await load("meshoptimizer/meshopt_decoder.mjs");
await MeshoptEncoder.ready;
await MeshoptDecoder.ready;

let state = 1;
const random = (below) => (state = (state * 48271) % 2147483647) % below;
const grid = [];
for (let row = 0; row < 12; row++) {
  for (let column = 0; column < 17; column++) {
    const a = row * 18 + column;
    grid.push(a, a + 18, a + 19, a, a + 19, a + 1);
  }
}
const [optimized] = MeshoptEncoder.reorderMesh(new Uint32Array(grid), true, true);
const anyhow = Uint32Array.from({ length: 300 }, (_, i) => (i % 3) * 1000 + random(1000));
const told = [];
const add = (mode, source, count, stride, filter) => {
  const coded = MeshoptEncoder.encodeGltfBuffer(source, count, stride, mode, 0);
  const decoded = new Uint8Array(count * stride);
  MeshoptDecoder.decodeGltfBuffer(decoded, count, stride, coded, mode, filter);
  const text = (bytes) => Buffer.from(bytes).toString("base64");
  told.push({ mode, count, stride, filter, coded: text(coded), decoded: text(decoded) });
};
for (const [indices, stride] of [[grid, 4], [optimized, 4], [anyhow, 4], [optimized, 2]]) {
  const typed = stride === 4 ? new Uint32Array(indices) : new Uint16Array(indices);
  add("TRIANGLES", new Uint8Array(typed.buffer), typed.length, stride);
}
for (const [count, stride] of [[1, 4], [300, 4], [530, 12], [700, 16], [40, 100]]) {
  const bytes = new Uint8Array(count * stride);
  for (let i = stride; i < bytes.length; i++) {
    bytes[i] = bytes[i - stride] + (random(9) ? random(1 + (i % 5)) : random(256));
  }
  add("ATTRIBUTES", bytes, count, stride);
}
for (const [stride, bits] of [[4, 8], [8, 10]]) {
  const normals = new Float32Array(4 * 60);
  for (let i = 0; i < 60; i++) {
    const [x, y, z] = [random(200) - 100, random(200) - 100, random(200) - 99.5];
    const length = Math.hypot(x, y, z);
    normals.set([x / length, y / length, z / length, 0], 4 * i);
  }
  const source = MeshoptEncoder.encodeFilterOct(normals, 60, stride, bits);
  add("ATTRIBUTES", source, 60, stride, "OCTAHEDRAL");
}
writeFileSync(output, `${JSON.stringify(told)}\n`);
