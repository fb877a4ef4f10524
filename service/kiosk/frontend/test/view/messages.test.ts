import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { readListing, readSeen } from "../../src/view/messages.ts";

const EXAMPLES = JSON.parse(readFileSync(new URL("../vectors/view.json", import.meta.url), "utf8"));

test("what the server says is read with all its fields", () => {
  for (const said of EXAMPLES.listings) assert.deepEqual(readListing(said), said);
  for (const said of EXAMPLES.seen) assert.deepEqual(readSeen(said), said);
});

test("missing fields have their default, what is no message is refused with the place", () => {
  assert.equal(readSeen({ kind: "seen", shape: "none", title: "x" }).problem, "");
  assert.throws(() => readSeen({ kind: "seen", shape: "cube", title: "x" }), /seen.shape/);
  assert.throws(() => readListing({ kind: "listing", items: [{}], version: "1" }), /items/);
});
