import assert from "node:assert/strict";
import { test } from "node:test";
import { fileName } from "../../src/view/saving.ts";

test("a picture is called as what it shows, without a folder", () => {
  for (const [title, name] of [
    ["take.oni, frame 3", "take_frame_3.png"], ["faces/Zoë.npz", "Zoë.png"], ["3f2a", "3f2a.png"],
    ["../../.npz", "face.png"], ["a\\b:c|d.ply", "b_c_d.png"],
  ] as const) {
    assert.equal(fileName(title), name);
  }
});
