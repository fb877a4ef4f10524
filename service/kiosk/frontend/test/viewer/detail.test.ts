import assert from "node:assert/strict";
import { test } from "node:test";

import { Detail, pixelRatio } from "../../src/viewer/detail.ts";

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

test("a large screen is drawn with fewer pixels where a processor does it", () => {
  assert.equal(pixelRatio(1280, 800, 1, true, false), 1);
  assert.equal(pixelRatio(1280, 800, 1, true, true), 1.5);
  assert.equal(pixelRatio(1280, 800, 1, false, false), 1);
  assert.equal(pixelRatio(480, 800, 3, false, true), 2);
  for (const still of [false, true]) {
    const ratio = pixelRatio(3840, 2160, 1, true, still);
    assert.ok(ratio < 0.6 && 3840 * 2160 * ratio ** 2 < 2.6e6);
  }
  assert.ok(1920 * 1080 * pixelRatio(1920, 1080, 2, false, false) ** 2 < 6.1e6);
});
