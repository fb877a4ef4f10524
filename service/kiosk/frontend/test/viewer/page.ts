/** What `tests/system/test_viewer.py` drives in a browser. */

import { decodeFaceGrid, type FaceGrid } from "../../src/face_grid.ts";
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

  get held(): number {
    return held;
  }

  /** Waits until nothing was drawn for so many milliseconds; throws where that never comes. */
  async still(forMs = 250, limitMs = 20_000): Promise<void> {
    const end = performance.now() + limitMs;
    for (let before = -1; before !== this.drawings;) {
      if (performance.now() > end) throw new Error("it never stands still");
      before = this.drawings;
      await new Promise((done) => setTimeout(done, forMs));
    }
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
