import assert from "node:assert/strict";
import { test } from "node:test";

import {
  SIGMA_RANGE_MM, sigmaColor, sigmaLegend, sigmaPosition,
} from "../../src/viewer/sigma_scale.ts";

/** Relative luminance as WCAG 2 defines it. */
function luminance(color: readonly number[]): number {
  const [r, g, b] = color.map((value) =>
    (value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4));
  return 0.2126 * r! + 0.7152 * g! + 0.0722 * b!;
}

test("the colours are told apart by lightness alone", () => {
  const levels = Array.from({ length: 33 }, (_, n) => luminance(sigmaColor(n / 32)));
  for (let n = 1; n < levels.length; n++) assert.ok(levels[n]! > levels[n - 1]!);
  assert.ok((levels.at(-1)! + 0.05) / (levels[0]! + 0.05) > 7);
});

test("the legend's marks are doublings from one end of the range to the other", () => {
  const marks = sigmaLegend();
  assert.deepEqual(marks.map(({ mm }) => mm), [0.5, 1, 2, 4]);
  assert.equal(marks[0]!.at, 0);
  assert.equal(marks.at(-1)!.at, 1);
  for (const { color } of marks) assert.match(color, /^rgb\(\d+ \d+ \d+\)$/);
});

test("beyond the range are the ends' colours", () => {
  assert.equal(sigmaPosition(SIGMA_RANGE_MM[0] / 9), 0);
  assert.equal(sigmaPosition(SIGMA_RANGE_MM[1] * 9), 1);
  assert.deepEqual(sigmaColor(-1), sigmaColor(0));
  assert.deepEqual(sigmaColor(2), sigmaColor(1));
});
