import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { readTable, Texts } from "../src/i18n.ts";

function texts(language: string, more: Record<string, string> = {}): Texts {
  const file = new URL(`../../languages/${language}.json`, import.meta.url);
  return new Texts(language, { ...readTable(JSON.parse(readFileSync(file, "utf8"))), ...more });
}

test("place holders are filled, numbers as the language writes them", () => {
  const german = texts("de", { some: "{count} von {all} {else}" });
  assert.equal(german.t("some", { count: 1234, all: "vielen" }), "1.234 von vielen {else}");
});

test("what is filled in is not looked through again", () => {
  const english = texts("en", { some: "{a} {b}" });
  assert.equal(english.t("some", { a: "{b}", b: "$&" }), "{b} $&");
});

test("a key without a text is seen; another one may take its place", () => {
  const english = texts("en");
  assert.equal(english.t("hint.never"), "hint.never");
  assert.equal(english.either("hint.never", "hint.nobody"), english.t("hint.nobody"));
  assert.equal(english.either("hint.move_back", "hint.nobody"), english.t("hint.move_back"));
});

test("Arabic runs from right to left, and has its own name", () => {
  assert.equal(texts("ar").direction, "rtl");
  assert.equal(texts("ar").name, "العربية");
  assert.equal(texts("fr").direction, "ltr");
});

test("durations are in the unit that fits, with the language's plural", () => {
  const english = texts("en");
  assert.deepEqual([30, 90, 1800, 7200, 86400, 30 * 86400].map((each) => english.duration(each)),
    ["30 seconds", "90 seconds", "30 minutes", "2 hours", "24 hours", "30 days"]);
  assert.equal(texts("de").duration(86400), "24 Stunden");
  assert.match(texts("ar").duration(86400), /ساعة/);
});

test("lengths in millimetres", () => {
  assert.equal(texts("en").millimetres(62.84, 1), "62.8 mm");
  assert.match(texts("fr").millimetres(62.84, 1), /^62,8\smm$/);
});

test("what is no language's file is refused", () => {
  for (const value of [null, [], "text", { a: 1 }]) assert.throws(() => readTable(value), TypeError);
});
