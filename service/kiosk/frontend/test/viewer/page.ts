/** What `tests/system/test_viewer.py` and `bench/viewer.py` drive in a browser. */

import { decodeFaceGrid, type FaceGrid } from "../../src/face_grid.ts";
import { drawn, openGraphics } from "../../src/viewer/graphics.ts";
import { Pose } from "../../src/viewer/pose.ts";
import { Stage } from "../../src/viewer/stage.ts";
import { toSurface, triangulate } from "../../src/viewer/surface.ts";
import { FaceViewer, type Mode } from "../../src/viewer/viewer.ts";

/** How many buffers, textures and programs WebGL holds. */
let held = 0;
for (const kind of ["Buffer", "Texture", "Program", "VertexArray"] as const) {
  const made = WebGL2RenderingContext.prototype[`create${kind}`];
  const gone = WebGL2RenderingContext.prototype[`delete${kind}`] as (given: unknown) => void;
  Object.assign(WebGL2RenderingContext.prototype, {
    [`create${kind}`](this: WebGL2RenderingContext) {
      held += 1;
      return made.call(this);
    },
    [`delete${kind}`](this: WebGL2RenderingContext, given: unknown) {
      if (given) held -= 1;
      gone.call(this, given);
    },
  });
}

const frames = (count: number): Promise<void> =>
  count === 0 ? Promise.resolve() : new Promise((done) => {
    requestAnimationFrame(() => void frames(count - 1).then(done));
  });

class Page {
  canvas = document.createElement("canvas");
  viewer: FaceViewer | undefined;
  drawings = 0;
  touches = 0;
  flat = false;
  #faces = new Map<string, Promise<FaceGrid>>();

  open(reducedMotion: boolean): void {
    this.viewer?.dispose();
    this.canvas.remove();
    this.canvas = document.createElement("canvas");
    this.canvas.tabIndex = 0;
    document.body.append(this.canvas);
    this.viewer = new FaceViewer(this.canvas, { reducedMotion, onFlat: () => (this.flat = true) });
    this.viewer.onTouched = () => (this.touches += 1);
    this.viewer.onSplit = () => (this.drawings += 1);
  }

  close(): void {
    this.viewer?.dispose();
    this.viewer = undefined;
    this.canvas.remove();
  }

  face(name: string): Promise<FaceGrid> {
    const known = this.#faces.get(name) ?? fetch(name)
      .then((answer) => answer.arrayBuffer()).then((bytes) => decodeFaceGrid(new Uint8Array(bytes)));
    this.#faces.set(name, known);
    return known;
  }

  async show(name: string): Promise<boolean> {
    return await this.viewer!.show(await this.face(name));
  }

  /** Shows many faces in a row. */
  async showMany(name: string, count: number): Promise<void> {
    for (let n = 0; n < count; n++) {
      await this.show(name);
      this.viewer!.mode = (["mesh", "points", "sigma"] as Mode[])[n % 3]!;
      await frames(1);
    }
  }

  /** Opens and closes many viewers in a row. */
  async openMany(name: string, count: number): Promise<void> {
    for (let n = 0; n < count; n++) {
      this.open(false);
      await this.show(name);
    }
  }

  /** Median times of making a face ready, ms: from bytes to a grid, to vertices, to triangles. */
  async readyMs(name: string, runs: number): Promise<[number, number, number]> {
    const bytes = new Uint8Array(await (await fetch(name)).arrayBuffer());
    const times: [number[], number[], number[]] = [[], [], []];
    for (let n = 0; n < runs; n++) {
      const start = performance.now();
      const face = await decodeFaceGrid(bytes);
      const decoded = performance.now();
      toSurface(face);
      const made = performance.now();
      triangulate(face);
      times[0].push(decoded - start);
      times[1].push(made - decoded);
      times[2].push(performance.now() - made);
    }
    return times.map((all) => all.sort((a, b) => a - b)[runs >> 1]!) as [number, number, number];
  }

  /** Draws a face again and again and waits for each; gives the median time, ms. */
  async drawMs(
    name: string, stride: number, mode: Mode, ratio: number, count: number,
  ): Promise<number> {
    const canvas = document.createElement("canvas");
    document.body.replaceChildren(canvas);
    const graphics = openGraphics(canvas)!;
    const stage = new Stage(canvas, graphics.context);
    stage.resize(canvas.clientWidth, canvas.clientHeight, ratio);
    stage.load(await this.face(name));
    const pose = new Pose(false);
    const times: number[] = [];
    for (let n = 0; n <= count; n++) {
      pose.rotate(1, 0, true);
      const start = performance.now();
      stage.draw({ view: pose.view, mode, confidence: 0, blend: 1, stride });
      await drawn(graphics.context);
      if (n > 0) times.push(performance.now() - start);
    }
    stage.dispose();
    canvas.remove();
    return times.sort((a, b) => a - b)[count >> 1]!;
  }

  /** Lets a face turn for some time; gives the pictures a second. */
  async turnFor(name: string, seconds: number): Promise<number> {
    this.open(false);
    await this.show(name);
    this.viewer!.turning = true;
    await frames(5);
    const before = this.drawings;
    const start = performance.now();
    await new Promise((done) => setTimeout(done, 1000 * seconds));
    const rate = (this.drawings - before) / ((performance.now() - start) / 1000);
    this.close();
    return rate;
  }

  get held(): number {
    return held;
  }

  /** Waits until nothing moves and all of it is on the screen; throws where that never comes. */
  async still(limitMs = 20_000): Promise<void> {
    const end = performance.now() + limitMs;
    // A wheel's turn may come a frame after it was asked for.
    for (await frames(2); !this.viewer!.resting; await frames(1)) {
      if (performance.now() > end) throw new Error("it never stands still");
    }
    await frames(2);
  }

  loseContext(): Promise<void> {
    const lost = new Promise<void>((done) =>
      this.canvas.addEventListener("webglcontextlost", () => done(), { once: true }));
    this.#loss().loseContext();
    return lost;
  }

  restoreContext(): Promise<void> {
    const back = new Promise<void>((done) =>
      this.canvas.addEventListener("webglcontextrestored", () => done(), { once: true }));
    this.#loss().restoreContext();
    return back;
  }

  #extension: WEBGL_lose_context | undefined;

  #loss(): WEBGL_lose_context {
    const context = this.canvas.getContext("webgl2")!;
    this.#extension = context.getExtension("WEBGL_lose_context") ?? this.#extension;
    return this.#extension!;
  }
}

Object.assign(window, { page: new Page() });
