import assert from "node:assert/strict";
import { afterEach, test } from "node:test";
import { Mirror } from "../src/mirror.ts";

const HEAD = { timestamp_us: 7, width: 4, height: 3 };
const JPEG = new Uint8Array([1]);

/** A page of which the test decodes the pictures. */
class Page {
  asked = 0;
  drawn = 0;
  closed = 0;
  decoding: { done(): void; fail(): void }[] = [];
  transforms: number[][] = [];
  readonly canvas = {
    width: 0, height: 0, dataset: {} as Record<string, string>, toggleAttribute: () => {},
    getContext: () => ({
      setTransform: (...matrix: number[]) => void this.transforms.push(matrix),
      drawImage: () => void this.drawn++, clearRect: () => {},
    }),
  };
  readonly mirror = new Mirror(this.canvas as unknown as HTMLCanvasElement, () => void this.asked++);

  constructor() {
    Object.assign(globalThis, {
      createImageBitmap: () => new Promise((resolve, reject) => this.decoding.push({
        done: () => resolve({ width: 4, height: 3, close: () => void this.closed++ }),
        fail: () => reject(new Error("no picture")),
      })),
    });
  }

  /** Lets a picture come, and gives what ends when it is dealt with. */
  come(): Promise<void> {
    return this.mirror.take(HEAD, JPEG);
  }
}

let page: Page;
function open(): Page {
  page = new Page();
  page.mirror.start();
  return page;
}
afterEach(() => page.mirror.stop());

test("the next picture is asked for once the last one is drawn", async () => {
  const { mirror, decoding } = open();
  mirror.start();
  assert.equal(page.asked, 1, "once, however often it is started");
  const first = page.come();
  assert.equal(page.asked, 1);
  decoding[0]?.done();
  await first;
  assert.deepEqual([page.drawn, page.closed, page.asked], [1, 1, 2]);
  assert.deepEqual(page.transforms, [[-1, 0, 0, 1, 4, 0]], "left and right are exchanged");
  assert.equal(page.canvas.dataset["timestamp"], "7");
});

test("a picture that comes while another is undrawn is left out", async () => {
  const { decoding } = open();
  const first = page.come();
  await page.come();
  assert.equal(decoding.length, 1);
  decoding[0]?.done();
  await first;
  assert.equal(page.asked, 2);
});

test("after the stop nothing is drawn and none asked for; the last one stays", async () => {
  const { mirror, decoding } = open();
  const first = page.come();
  mirror.stop();
  decoding[0]?.done();
  await first;
  await page.come();
  assert.deepEqual([page.drawn, page.closed, page.asked], [0, 1, 1]);
  mirror.clear();
  assert.equal(page.canvas.dataset["timestamp"], undefined);
});

test("a damaged picture is left out, the next one asked for", async (context) => {
  context.mock.method(console, "warn", () => {});
  const { decoding } = open();
  const first = page.come();
  decoding[0]?.fail();
  await first;
  assert.deepEqual([page.drawn, page.asked], [0, 2]);
});

test("what does not come is asked for again", (context) => {
  context.mock.timers.enable({ apis: ["setTimeout"] });
  open();
  context.mock.timers.tick(2999);
  assert.equal(page.asked, 1);
  context.mock.timers.tick(1);
  context.mock.timers.tick(3000);
  assert.equal(page.asked, 3);
  page.mirror.restart();
  assert.equal(page.asked, 4);
  page.mirror.stop();
  context.mock.timers.tick(10_000);
  assert.equal(page.asked, 4);
});
