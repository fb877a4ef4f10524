import assert from "node:assert/strict";
import { test } from "node:test";

import { Detail } from "../../src/viewer/detail.ts";

function frames(detail: Detail, ms: number, count = 96): number {
  for (let n = 0; n < count; n++) detail.took(ms);
  return detail.stride;
}

test("a graphics card draws every point, a processor every second at first", () => {
  assert.equal(new Detail(false).stride, 1);
  assert.equal(new Detail(true).stride, 2);
});

test("slow frames make it coarser, up to a limit", () => {
  assert.equal(frames(new Detail(false), 200), 3);
});

test("quick frames make it finer, but never again what was too slow", () => {
  const detail = new Detail(true);
  assert.equal(frames(detail, 8), 1);
  frames(detail, 200, 8);
  assert.equal(detail.stride, 2);
  assert.equal(frames(detail, 8), 2);
});

test("one slow frame among quick ones changes nothing", () => {
  const detail = new Detail(false);
  for (let n = 0; n < 80; n++) detail.took(n % 8 === 0 ? 900 : 16);
  assert.equal(detail.stride, 1);
});
