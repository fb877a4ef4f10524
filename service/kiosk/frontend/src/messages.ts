/**
 * What page and server say to each other: the mirror of `page_messages.py`, word for word.
 * `test/messages.test.ts` and a Python test hold both to the same examples.
 */
import {
  type Checked, count, fields, flag, list, oneOf, or, orNull, real, table, text,
} from "./shape.ts";

/** First byte of a binary message. */
export const MIRROR = 1;
export const FACE = 2;

// --- page to server

/** Everything that a page says, without the number of the visit. */
export type Said =
  | { readonly kind: "begin" | "press" | "next" | "touch" | "cancel" | "again" | "keep" | "delete"
      | "done" }
  | { readonly kind: "consent"; readonly agreed: boolean; readonly language: string }
  | { readonly kind: "drawn"; readonly capture_id: string };

/** What a page says of the visit that it shows. */
export type FromPage = Said & { readonly visit: number };

// --- server to page

const screenName = oneOf(
  "attract", "consent", "position", "countdown", "captured", "reconstructing", "result", "keep",
  "deleting", "failed", "thanks", "busy",
);
const trouble = oneOf("sensor", "worker", "hub", "disk");
const arrow = oneOf("left", "right", "up", "down", "closer", "back");

const consent = fields({
  retention_s: orNull(real),
  text_version: text,
  text: orNull(table(list(text))),
  links: or(flag, false),
});

const position = fields({
  hint: orNull(text),
  arrow: orNull(arrow),
  progress: or(real, 0),
  can_press: or(flag, false),
  with_warnings: or(flag, false),
});

export const measurement = fields({ name: text, value_mm: real, low_mm: real, high_mm: real });

const result = fields({
  capture_id: text,
  warnings: or(list(text), []),
  initial_points: or(count, 0),
  dense_points: or(count, 0),
  can_keep: or(flag, false),
  no_links: or(flag, false),
  measurements: orNull(list(measurement)),
});

const keep = fields({
  page: text,
  qr: list(text),
  links: or(list(fields({ format: text, url: text })), []),
  uses: count,
  expires_s: real,
});

const screen = fields({
  kind: oneOf("screen"),
  visit: count,
  name: screenName,
  trouble: orNull(trouble),
  leaving_s: orNull(real),
  consent: orNull(consent),
  position: orNull(position),
  countdown: orNull(fields({ left: count })),
  result: orNull(result),
  keep: orNull(keep),
  failed: orNull(fields({ why: text, hint: orNull(text) })),
  thanks: orNull(fields({ deleted: orNull(flag), retention_s: orNull(real) })),
});

const hello = fields({
  kind: oneOf("hello"),
  languages: list(text),
  sound: or(flag, false),
  speech: or(flag, true),
  version: text,
});

const mirrorHead = fields({ timestamp_us: real, width: count, height: count });
const faceHead = fields({ capture_id: text, visit: count });

export type ScreenName = Checked<typeof screenName>;
export type Trouble = Checked<typeof trouble>;
export type Arrow = Checked<typeof arrow>;
export type Measurement = Checked<typeof measurement>;
export type ResultScreen = Checked<typeof result>;
export type KeepScreen = Checked<typeof keep>;
/** The whole of what a page shows. */
export type Screen = Checked<typeof screen>;
/** The first message: what the operator has set. */
export type Hello = Checked<typeof hello>;
export type MirrorHead = Checked<typeof mirrorHead>;
export type FaceHead = Checked<typeof faceHead>;

/** A binary message, taken apart; `payload` is a view of the message. */
export type Binary =
  | { readonly kind: typeof MIRROR; readonly head: MirrorHead; readonly payload: Uint8Array<ArrayBuffer> }
  | { readonly kind: typeof FACE; readonly head: FaceHead; readonly payload: Uint8Array<ArrayBuffer> };

/** Reads a text message; throws a TypeError or SyntaxError where it is none. */
export function readText(said: string): Hello | Screen {
  const value: unknown = JSON.parse(said);
  const { kind } = fields({ kind: oneOf("hello", "screen") })(value, "message");
  return kind === "hello" ? hello(value, "hello") : screen(value, "screen");
}

/**
 * Reads a binary message: one byte, the length of a JSON object (4 bytes, little-endian), that
 * object, the payload. Throws a TypeError, SyntaxError or RangeError where it is none.
 */
export function readBinary(said: ArrayBuffer): Binary {
  const view = new DataView(said);
  const kind = view.getUint8(0);
  const length = view.getUint32(1, true);
  const json = new TextDecoder("utf-8", { fatal: true }).decode(new Uint8Array(said, 5, length));
  const value: unknown = JSON.parse(json);
  const payload = new Uint8Array(said, 5 + length);
  switch (kind) {
    case MIRROR: return { kind, head: mirrorHead(value, "mirror"), payload };
    case FACE: return { kind, head: faceHead(value, "face"), payload };
    default: throw new TypeError(`binary message of kind ${kind}`);
  }
}
