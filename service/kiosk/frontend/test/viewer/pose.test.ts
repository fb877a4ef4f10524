import assert from "node:assert/strict";
import { test } from "node:test";

import { Pose } from "../../src/viewer/pose.ts";

/** Lets a pose go on until it stands, at most a minute. */
function settle(pose: Pose): void {
  for (let frame = 0; frame < 3600; frame++) if (!pose.step(1 / 60)) return;
  assert.fail("it never stands");
}

test("it swings to both sides and never shows the back", () => {
  const pose = new Pose(false);
  pose.turning = true;
  const yaws: number[] = [];
  for (let frame = 0; frame < 60 * 30; frame++) {
    assert.ok(pose.step(1 / 60));
    yaws.push(pose.view.yaw);
  }
  assert.ok(Math.max(...yaws) > 30 && Math.max(...yaws) < 40);
  assert.ok(Math.min(...yaws) < -30 && Math.min(...yaws) > -40);
});

test("where the swing is interrupted it stands, and goes on from there", () => {
  const pose = new Pose(false);
  pose.turning = true;
  for (let frame = 0; frame < 150; frame++) pose.step(1 / 60);
  pose.turning = false;
  const { yaw } = pose.view;
  settle(pose);
  assert.ok(Math.abs(pose.view.yaw - yaw) < 1);
  pose.turning = true;
  pose.step(1 / 60);
  assert.ok(Math.abs(pose.view.yaw - yaw) < 2);
});

test("with reduced motion nothing moves by itself, and all is there at once", () => {
  const pose = new Pose(true);
  pose.turning = true;
  assert.equal(pose.turning, false);
  pose.rotate(20, 10);
  assert.equal(pose.step(1 / 60), false);
  assert.equal(pose.view.yaw, 20);
});

test("there are limits to turning, zooming and moving", () => {
  const pose = new Pose(false);
  for (let n = 0; n < 100; n++) {
    pose.rotate(30, -30, true);
    pose.zoom(1.5, true);
    pose.pan(1, -1, true);
  }
  assert.ok(pose.view.yaw <= 80 && pose.view.pitch >= -60);
  assert.ok(pose.view.zoom <= 8);
  assert.ok(pose.view.panX <= 1 && pose.view.panY >= -1);
  for (let n = 0; n < 100; n++) pose.zoom(0.5, true);
  assert.ok(pose.view.zoom >= 0.5);
  assert.ok(pose.view.panX === 0 && pose.view.panY === 0, "far away it is in the middle");
});

test("a factor that is none changes nothing", () => {
  const pose = new Pose(false);
  for (const factor of [0, -1, Number.NaN]) pose.zoom(factor, true);
  assert.equal(pose.view.zoom, 1);
});

test("reset goes back smoothly and arrives", () => {
  const pose = new Pose(false);
  pose.rotate(60, 20, true);
  pose.zoom(3, true);
  pose.reset();
  assert.ok(pose.step(1 / 60));
  assert.ok(pose.view.yaw > 30);
  settle(pose);
  assert.deepEqual({ ...pose.view }, { yaw: 0, pitch: 0, zoom: 1, panX: 0, panY: 0 });
});

test("where all sides may be seen it turns round, and back to the front the short way", () => {
  const pose = new Pose(false, true);
  pose.rotate(3 * 360 + 170, 300);
  settle(pose);
  assert.deepEqual([pose.view.yaw, pose.view.pitch], [3 * 360 + 170, 89]);
  pose.reset();
  pose.step(1 / 60);
  assert.ok(pose.view.yaw > 0 && pose.view.yaw < 170);
});

test("it takes another one's view at once", () => {
  const pose = new Pose(false);
  pose.take({ yaw: 20, pitch: -10, zoom: 2, panX: 0.1, panY: -0.1 });
  assert.deepEqual(pose.view, { yaw: 20, pitch: -10, zoom: 2, panX: 0.1, panY: -0.1 });
  assert.equal(pose.step(1 / 60), false);
});
