/**
 * What the page of `denseface view` is told: the mirror of `service/view/messages.py`.
 * `test/view_messages.test.ts` and a Python test hold both to the same examples.
 */
import { measurement } from "../messages.ts";
import { type Checked, count, fields, flag, list, oneOf, or, orNull, text } from "../shape.ts";

const item = fields({
  name: text,
  kind: oneOf("face", "frames", "capture", "mesh"),
  first: or(count, 0),
  frames: orNull(count),
});

const listing = fields({
  kind: oneOf("listing"),
  items: list(item),
  version: text,
  once: or(flag, false),
});

const fact = fields({ name: text, value: text });

const seen = fields({
  kind: oneOf("seen"),
  shape: oneOf("face", "mesh", "none"),
  title: text,
  problem: or(text, ""),
  picture: or(flag, false),
  figures: or(list(fact), []),
  measurements: or(list(measurement), []),
  warnings: or(list(text), []),
  provenance: or(list(fact), []),
  report: or(text, ""),
});

/** One thing that can be looked at. */
export type Item = Checked<typeof item>;
/** All of them. */
export type Listing = Checked<typeof listing>;
/** A line of a table. */
export type Fact = Checked<typeof fact>;
/** What is to be said of one frame of one thing. */
export type Seen = Checked<typeof seen>;

/** Reads what can be looked at; throws a TypeError where it is none. */
export function readListing(value: unknown): Listing {
  return listing(value, "listing");
}

/** Reads what is to be said of a frame; throws a TypeError where it is none. */
export function readSeen(value: unknown): Seen {
  return seen(value, "seen");
}
