import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import {
  FACE, type FromPage, MIRROR, readBinary, readText,
} from "../src/messages.ts";

const EXAMPLES = JSON.parse(readFileSync(new URL("vectors/messages.json", import.meta.url), "utf8"));

/** What the page says, as its types have it: the examples in the same order. */
const SAID: readonly FromPage[] = [
  { kind: "begin", visit: 0 }, { kind: "press", visit: 1 }, { kind: "next", visit: 2 },
  { kind: "touch", visit: 3 }, { kind: "cancel", visit: 4 }, { kind: "again", visit: 5 },
  { kind: "keep", visit: 6 }, { kind: "delete", visit: 7 }, { kind: "done", visit: 8 },
  { kind: "consent", visit: 9, agreed: true, language: "zh-Hant" },
  { kind: "consent", visit: 9, agreed: false, language: "ar" },
  { kind: "drawn", visit: 9, capture_id: "Kf3_vZ-0" },
];

function binary(kind: number, head: string, payload: readonly number[] = []): ArrayBuffer {
  const json = new TextEncoder().encode(head);
  const said = new Uint8Array(5 + json.length + payload.length);
  said[0] = kind;
  new DataView(said.buffer).setUint32(1, json.length, true);
  said.set(json, 5);
  said.set(payload, 5 + json.length);
  return said.buffer;
}

test("the page says what the server reads", () => {
  const sorted = (said: object): string => JSON.stringify(Object.entries(said).sort());
  assert.deepEqual(SAID.map(sorted), EXAMPLES.from_page.map(sorted));
});

test("each message of the server is read with all its fields", () => {
  for (const said of EXAMPLES.to_page) assert.deepEqual(readText(JSON.stringify(said)), said);
});

test("binary messages are taken apart", () => {
  for (const [kind, heads] of [[MIRROR, EXAMPLES.mirror_heads], [FACE, EXAMPLES.face_heads]]) {
    for (const head of heads) {
      const read = readBinary(binary(kind, JSON.stringify(head), [1, 2, 3]));
      assert.equal(read.kind, kind);
      assert.deepEqual(read.head, head);
      assert.deepEqual([...read.payload], [1, 2, 3]);
    }
  }
});

test("fields of a newer server are left out, missing ones have their default", () => {
  const screen = readText('{"kind": "screen", "visit": 3, "name": "position", "position": {}, "new": 1}');
  assert.ok(screen.kind === "screen" && !("new" in screen));
  assert.deepEqual(screen.position,
    { hint: null, arrow: null, progress: 0, can_press: false, with_warnings: false });
  assert.equal(screen.trouble, null);
});

test("what is no message is refused with the place", () => {
  for (const [said, complaint] of [
    ["{}", /message.kind: hello | screen expected/],
    ["null", /message: an object expected/],
    ['{"kind": "screen", "visit": 1, "name": "heaven"}', /screen.name: attract/],
    ['{"kind": "screen", "visit": -1, "name": "attract"}', /screen.visit: a whole number/],
    ['{"kind": "screen", "visit": 1, "name": "keep", "keep": {"page": 1}}', /screen.keep.page: text/],
    ['{"kind": "hello", "languages": ["en", 5], "version": "1"}', /hello.languages\[1\]: text/],
    ['{"kind": "hello", "languages": "en", "version": "1"}', /hello.languages: a list/],
  ] as const) {
    assert.throws(() => readText(said), { name: "TypeError", message: complaint });
  }
  assert.throws(() => readText("?"), SyntaxError);
});

test("what is no binary message is refused", () => {
  const head = '{"capture_id": "a", "visit": 1}';
  assert.throws(() => readBinary(new ArrayBuffer(0)), RangeError);
  assert.throws(() => readBinary(binary(FACE, head).slice(0, 20)), RangeError);
  assert.throws(() => readBinary(binary(3, head)), TypeError);
  assert.throws(() => readBinary(binary(MIRROR, head)), /mirror.timestamp_us/);
  assert.throws(() => readBinary(binary(FACE, "{")), SyntaxError);
});
