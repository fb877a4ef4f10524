// Reads docs/vectors as docs/wire.md says: of every message its header and all of its arrays.
//   node read_vectors.mjs FOLDER
import assert from "node:assert/strict";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";

const half = (bits) => (bits < 1024 ? bits * 2 ** -24
  : (1024 + (bits & 1023)) * 2 ** ((bits >> 10) - 25));
const ELEMENTS = {
  "|u1": [1, (bytes, at) => bytes.readUInt8(at)],
  "<u2": [2, (bytes, at) => bytes.readUInt16LE(at)],
  "<i2": [2, (bytes, at) => bytes.readInt16LE(at)],
  "<f4": [4, (bytes, at) => bytes.readFloatLE(at)],
  "<f2": [2, (bytes, at) => half(bytes.readUInt16LE(at))],
};

// Nested lists of a shape, in C order.
function nested(values, shape) {
  if (shape.length < 2) return values;
  const size = values.length / shape[0];
  return Array.from({ length: shape[0] }, (_, row) =>
    nested(values.slice(row * size, (row + 1) * size), shape.slice(1)));
}

const [folder] = process.argv.slice(2);
const kinds = new Set();
for (const file of readdirSync(folder).filter((name) => name.endsWith(".bin"))) {
  const said = JSON.parse(readFileSync(join(folder, file.replace(/bin$/, "json")), "utf8"));
  if (!said.parts) continue; // the face for browsers, which the page's own tests read
  const data = readFileSync(join(folder, file));
  let end = 0;
  const parts = said.parts.map((size) => data.subarray(end, end += size));
  assert.equal(end, data.length, file);
  if (said.topic) assert.equal(parts.shift().toString(), said.topic);
  const header = JSON.parse(parts.shift());
  assert.deepEqual(header, said.header, file);
  assert.equal(header.version, 2);
  const { arrays } = header.frame ?? header.face ?? header.preview ?? { arrays: [] };
  assert.equal(parts.length, arrays.length, file);
  const read = Object.fromEntries(arrays.map(({ name, dtype, shape }, i) => {
    const [size, element] = ELEMENTS[dtype];
    assert.equal(parts[i].length, shape.reduce((a, b) => a * b, size), `${file}: ${name}`);
    return [name, nested(Array.from({ length: parts[i].length / size },
      (_, at) => element(parts[i], size * at)), shape)];
  }));
  assert.deepEqual(read, said.arrays, file);
  kinds.add(header.kind);
}
console.log([...kinds].sort().join(" "));
