import assert from "node:assert/strict";
import { test } from "node:test";
import { FACE } from "../src/messages.ts";
import { Socket } from "../src/socket.ts";

/** A browser of which the test is the network and the clock. */
class Browser {
  sockets: { sent: string[]; readyState: number; binaryType: string;
    onmessage?: (event: { data: unknown }) => void; onclose?: () => void; send(text: string): void }[] = [];
  waits: number[] = [];
  complaints: unknown[] = [];
  calls: (() => void)[] = [];
  heard: unknown[] = [];
  readonly socket = new Socket("ws://here/ws", {
    hello: (hello) => this.heard.push(["hello", hello.version]),
    screen: (screen) => this.heard.push(["screen", screen.name]),
    mirror: (head) => this.heard.push(["mirror", head.width]),
    face: (head, grid) => this.heard.push(["face", head.capture_id, grid.length]),
    gone: () => this.heard.push("gone"),
    outdated: () => this.heard.push("outdated"),
  }, {
    open: () => {
      const sent: string[] = [];
      this.sockets.push({ sent, readyState: 1, binaryType: "", send: (text) => void sent.push(text) });
      return this.sockets.at(-1) as unknown as WebSocket;
    },
    later: (call, ms) => {
      this.waits.push(ms);
      this.calls.push(call);
    },
    complain: (_text, error) => this.complaints.push(error),
  });

  get last() {
    const last = this.sockets.at(-1);
    assert.ok(last);
    return last;
  }

  hear(data: unknown): void {
    this.last.onmessage?.({ data });
  }

  hello(version: string): void {
    this.hear(JSON.stringify({ kind: "hello", languages: ["en"], version }));
  }

  lose(): void {
    this.last.readyState = 3;
    this.last.onclose?.();
    this.calls.pop()?.();
  }
}

test("texts and binary messages are told of", () => {
  const browser = new Browser();
  browser.socket.connect();
  assert.equal(browser.last.binaryType, "arraybuffer");
  browser.hello("1");
  browser.hear('{"kind": "screen", "visit": 1, "name": "attract"}');
  const head = new TextEncoder().encode('{"capture_id": "a", "visit": 1}');
  const said = new Uint8Array([FACE, head.length, 0, 0, 0, ...head, 7, 7]);
  browser.hear(said.buffer);
  assert.deepEqual(browser.heard, [["hello", "1"], ["screen", "attract"], ["face", "a", 2]]);
});

test("what is no message is left out and complained of", () => {
  const browser = new Browser();
  browser.socket.connect();
  for (const data of ["?", "{}", new ArrayBuffer(3)]) browser.hear(data);
  assert.equal(browser.complaints.length, 3);
  assert.deepEqual(browser.heard, []);
});

test("it comes back, waits longer each time, and begins anew once it was heard", () => {
  const browser = new Browser();
  browser.socket.connect();
  for (let i = 0; i < 6; i++) browser.lose();
  assert.deepEqual(browser.waits, [250, 500, 1000, 2000, 2000, 2000]);
  assert.deepEqual(browser.heard, ["gone"], "told once");
  browser.hello("1");
  browser.lose();
  assert.equal(browser.waits.at(-1), 250);
  assert.deepEqual(browser.heard, ["gone", ["hello", "1"], "gone"]);
});

test("a server of another version is told of, the same one is not", () => {
  const browser = new Browser();
  browser.socket.connect();
  browser.hello("1");
  browser.lose();
  browser.hello("1");
  browser.lose();
  browser.hello("2");
  assert.deepEqual(browser.heard.at(-1), "outdated");
  assert.equal(browser.heard.filter((each) => each === "outdated").length, 1);
});

test("what an older connection says counts no more", () => {
  const browser = new Browser();
  browser.socket.connect();
  browser.lose();
  browser.sockets[0]?.onmessage?.({ data: '{"kind": "screen", "visit": 1, "name": "busy"}' });
  browser.sockets[0]?.onclose?.();
  assert.deepEqual(browser.heard, ["gone"]);
  assert.equal(browser.waits.length, 1);
});

test("it says what is to be said where somebody listens", () => {
  const browser = new Browser();
  assert.equal(browser.socket.say({ kind: "begin", visit: 1 }), false);
  browser.socket.connect();
  assert.equal(browser.socket.say({ kind: "begin", visit: 1 }), true);
  assert.deepEqual(browser.last.sent, ['{"kind":"begin","visit":1}']);
  browser.last.readyState = 2;
  assert.equal(browser.socket.say({ kind: "begin", visit: 1 }), false);
});
