import assert from "node:assert/strict";
import { test } from "node:test";
import { listen } from "../src/input.ts";

class FakeElement {
  readonly kind: string;

  constructor(kind: string) {
    this.kind = kind;
  }

  closest(kinds: string): this | null {
    return kinds.split(", ").includes(this.kind) ? this : null;
  }
}
class FakeInput extends FakeElement {}
Object.assign(globalThis, { Element: FakeElement, HTMLInputElement: FakeInput });

/** A page and what its visitor did, as it was understood. */
class Page {
  did: string[] = [];
  private now = 0;
  private readonly listeners: [string, (event: object) => void][] = [];

  constructor() {
    listen({
      documentElement: { dataset: {} },
      addEventListener: (kind: string, call: (event: object) => void) =>
        void this.listeners.push([kind, call]),
    } as unknown as Document, {
      touch: () => void this.did.push("touch"),
      press: () => void this.did.push("press"),
      escape: () => void this.did.push("escape"),
      key: (key) => this.did.push(key) > 0,
    });
  }

  /** Lets something happen; gives whether the browser's own doing was prevented. */
  happens(kind: string, more: object = {}, after = 1000): boolean {
    this.now += after;
    let prevented = false;
    const event = {
      timeStamp: this.now, repeat: false, target: new FakeElement("body"), ...more,
      preventDefault: () => void (prevented = true),
    };
    for (const [listened, call] of this.listeners) if (listened === kind) call(event);
    return prevented;
  }
}

test("touches are told of at most twice a second", () => {
  const page = new Page();
  for (let i = 0; i < 10; i++) page.happens("pointermove", {}, 100);
  assert.deepEqual(page.did, ["touch", "touch"]);
});

test("Enter and Space are the button where none has the focus", () => {
  const page = new Page();
  assert.ok(page.happens("keydown", { key: "Enter" }));
  assert.ok(page.happens("keydown", { key: " " }));
  assert.ok(!page.happens("keydown", { key: "Enter", target: new FakeElement("button") }));
  assert.deepEqual(page.did.filter((each) => each !== "touch"), ["press", "press"]);
});

test("a held key is one key, but arrows go on", () => {
  const page = new Page();
  assert.ok(page.happens("keydown", { key: "Enter", repeat: true }), "no click of a button either");
  page.happens("keydown", { key: "Escape", repeat: true });
  page.happens("keydown", { key: "ArrowLeft", repeat: true });
  assert.deepEqual(page.did.filter((each) => each !== "touch"), ["ArrowLeft"]);
});

test("arrows move the slider that has the focus, else the face", () => {
  const page = new Page();
  assert.ok(!page.happens("keydown", { key: "ArrowUp", target: new FakeInput("input") }));
  assert.ok(page.happens("keydown", { key: "ArrowUp" }));
  assert.deepEqual(page.did.filter((each) => each !== "touch"), ["ArrowUp"]);
});

test("the browser's own keys, menus and selections are no part of it", () => {
  const page = new Page();
  page.happens("keydown", { key: "+", ctrlKey: true });
  assert.deepEqual(page.did, ["touch"]);
  for (const kind of ["contextmenu", "selectstart", "dragstart"]) assert.ok(page.happens(kind));
});
