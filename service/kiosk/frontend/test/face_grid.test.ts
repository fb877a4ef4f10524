import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { deflateSync, inflateSync } from "node:zlib";

import { decodeFaceGrid, FaceGridError, sigmaOf } from "../src/face_grid.ts";

/** What the service's own reader finds in `dome.face`. */
interface Expected {
  header: Record<string, number>;
  cells: [number, number][];
  points: [number, number, number][];
  colors: [number, number, number][];
  sigma: number[];
  seeds: [number, number, number][];
  seed_colors: [number, number, number][];
}

const vectors = new URL("vectors/", import.meta.url);
const dome = new Uint8Array(readFileSync(new URL("dome.face", vectors)));
const expected = JSON.parse(readFileSync(new URL("dome.json", vectors), "utf8")) as Expected;
const PREFIX = 12;

function headerLength(bytes: Uint8Array): number {
  return new DataView(bytes.buffer, bytes.byteOffset).getUint32(8, true);
}

/** The vector with another byte. */
function changed(at: number, byte: number): Uint8Array {
  const out = dome.slice();
  out[at] = byte;
  return out;
}

/** The vector with another header or body. */
function remade(
  change: Record<string, unknown>, body: (body: Buffer) => Uint8Array = (given) => given,
): Uint8Array {
  const end = PREFIX + headerLength(dome);
  const header = JSON.parse(new TextDecoder().decode(dome.subarray(PREFIX, end)));
  const text = new TextEncoder().encode(JSON.stringify({ ...header, ...change }));
  const packed = deflateSync(body(inflateSync(dome.subarray(end))));
  const out = new Uint8Array(PREFIX + text.length + packed.length);
  out.set(dome.subarray(0, PREFIX));
  new DataView(out.buffer).setUint32(8, text.length, true);
  out.set(text, PREFIX);
  out.set(packed, PREFIX + text.length);
  return out;
}

test("every point, colour and sigma is as the service reads it", async () => {
  const face = await decodeFaceGrid(dome);
  assert.equal(face.points, expected.points.length);
  assert.deepEqual(Array.from(face.places),
    expected.cells.map(([row, column]) => row * face.columns + column));
  expected.points.forEach(([x, y, z], point) => {
    const place = face.places[point]!;
    assert.equal(face.index[place], point);
    assert.ok(Math.abs(face.leftMm + (place % face.columns) * face.stepMm - x) < 1e-4);
    assert.ok(Math.abs(face.topMm + Math.floor(place / face.columns) * face.stepMm - y) < 1e-4);
    assert.ok(Math.abs(face.z[point]! - z) < 1e-4);
    const [red, green, blue, code] = face.colors.subarray(4 * point, 4 * point + 4);
    assert.deepEqual([red, green, blue], expected.colors[point]);
    assert.ok(Math.abs(sigmaOf(code!, face.sigmaMm) - expected.sigma[point]!) < 1e-4);
  });
  assert.equal(face.index.filter((point) => point >= 0).length, face.points);
});

test("the initial cloud is as the service reads it", async () => {
  const { seeds, spacingMm } = await decodeFaceGrid(dome);
  assert.equal(seeds.points, expected.seeds.length);
  assert.equal(spacingMm, expected.header["spacing_mm"]);
  assert.deepEqual(Array.from(seeds.colors), expected.seed_colors.flat());
  expected.seeds.flat().forEach((value, at) => {
    assert.ok(Math.abs(seeds.positions[at]! - value) < 1e-4);
  });
});

test("the test vector of docs/wire.md is read as it says", async () => {
  const docs = new URL("../../../../docs/vectors/", import.meta.url);
  const face = await decodeFaceGrid(readFileSync(new URL("face_grid.bin", docs)));
  const { initial, dense } = JSON.parse(readFileSync(new URL("face_grid.json", docs), "utf8")).decoded;
  const near = (found: number, told: number) => assert.ok(Math.abs(found - told) <= 1e-4 * told);
  assert.equal(face.points, dense.points.length);
  dense.points.forEach(([, , z]: number[], point: number) => {
    const [row, column] = dense.cells[point];
    assert.equal(face.places[point], row * face.columns + column);
    near(face.z[point]!, z!);
    const [red, green, blue, code] = face.colors.subarray(4 * point, 4 * point + 4);
    assert.deepEqual([red, green, blue], dense.colors[point]);
    near(sigmaOf(code!, face.sigmaMm), dense.sigma[point]);
  });
  assert.deepEqual(Array.from(face.seeds.colors), initial.colors.flat());
});

test("bytes in the middle of a buffer are read alike", async () => {
  const within = new Uint8Array(dome.length + 7);
  within.set(dome, 3);
  const face = await decodeFaceGrid(within.subarray(3, 3 + dome.length));
  assert.deepEqual(face, await decodeFaceGrid(dome));
});

test("unknown fields of a header are left alone", async () => {
  assert.deepEqual(await decodeFaceGrid(remade({ later: 1 })), await decodeFaceGrid(dome));
});

const support = 31 * 3;
const malformed: Record<string, [Uint8Array, RegExp]> = {
  "nothing": [new Uint8Array(0), /no face's grid/],
  "another file": [new TextEncoder().encode("glTF, surely not a face"), /no face's grid/],
  "another version": [changed(4, 9), /version 9, expected 1/],
  "a header longer than the file": [changed(11, 0x7f), /header of \d+ bytes/],
  "a header that is no JSON": [changed(PREFIX, 0x7e), /no JSON/],
  "a grid without end": [remade({ rows: 2 ** 20, columns: 2 ** 20 }), /columns/],
  "rows that are no number": [remade({ rows: "31" }), /rows is "31"/],
  "half a row": [remade({ rows: 30.5 }), /no whole number/],
  "no step": [remade({ step_mm: null }), /step_mm is null/],
  "more points than places": [remade({ points: 1e6 }), /points is 1000000/],
  "a point more": [remade({ points: expected.points.length + 1 }), /its header says/],
  "many seeds": [remade({ seeds: 2 ** 22 }), /bytes are claimed/],
  "a sigma of 0": [remade({ sigma_mm: [0, 1] }), /sigma_mm/],
  "sigmas in the wrong order": [remade({ sigma_mm: [2, 1] }), /sigma_mm/],
  "a body too short": [remade({}, (body) => body.subarray(1)), /its header says/],
  "a body too long": [remade({}, (body) => Buffer.concat([body, body])), /more than the/],
  "bytes behind the body": [new Uint8Array([...dome, 0]), /damaged/],
  "a flipped bit": [changed(dome.length - 1, dome.at(-1)! ^ 16), /damaged/],
  "an empty support": [remade({}, (body) => body.fill(0, 0, support)), /support/],
  "a place beyond the columns": [remade({}, (body) => body.fill(255, 2, 3)), /support/],
  "long residuals that are missing":
    [remade({}, (body) => body.fill(255, support, support + 100)), /more long residuals/],
  "long residuals that are left":
    [remade({}, (body) => body.fill(0, support, support + expected.points.length)), /fewer long/],
};

for (const [name, [bytes, message]] of Object.entries(malformed)) {
  test(`refused with one clear line: ${name}`, async () => {
    await assert.rejects(decodeFaceGrid(bytes), (error) => {
      assert.ok(error instanceof FaceGridError);
      assert.match(error.message, message);
      assert.ok(!error.message.includes("\n"));
      return true;
    });
  });
}

test("cut off anywhere it is refused", async () => {
  for (let end = 0; end < dome.length; end += 7) {
    await assert.rejects(decodeFaceGrid(dome.slice(0, end)), FaceGridError);
  }
});

/** Numbers that look random and are the same in every run (mulberry32). */
function* numbers(seed: number): Generator<number> {
  for (let a = seed; ;) {
    a = (a + 0x6d2b79f5) | 0;
    let t = Math.imul(a ^ (a >>> 15), 1 | a);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    yield ((t ^ (t >>> 14)) >>> 0) / 2 ** 32;
  }
}

test("bytes changed at random are read or refused, and nothing else", async () => {
  const random = numbers(12);
  const next = (below: number): number => Math.floor(random.next().value! * below);
  const spoil = (bytes: Uint8Array): Uint8Array => {
    for (let n = 0; n <= next(4); n++) bytes[next(bytes.length)] = next(256);
    return bytes;
  };
  let read = 0;
  for (let round = 0; round < 400; round++) {
    const given = round % 2 === 0 ? spoil(dome.slice()) : remade({}, spoil);
    try {
      const face = await decodeFaceGrid(given);
      assert.ok(face.z.every(Number.isFinite) && face.seeds.positions.every(Number.isFinite));
      read += 1;
    } catch (error) {
      assert.ok(error instanceof FaceGridError, String(error));
    }
  }
  assert.ok(read > 20 && read < 380, `${read} of 400 were read`);
});
