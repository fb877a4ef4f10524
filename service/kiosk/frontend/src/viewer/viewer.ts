/** A face to be looked at: turns by itself until touched, is turned, brought nearer and compared. */

import { Detail, pixelRatio } from "./detail.ts";
import { drawFlat, type Mode } from "./flat.ts";
import { listen } from "./gestures.ts";
import { drawn, openGraphics, type Graphics } from "./graphics.ts";
import { isMesh, type Shape } from "./loaded.ts";
import { Pose, type View } from "./pose.ts";
import { SIGMA_RANGE_MM } from "./sigma_scale.ts";
import { Stage } from "./stage.ts";

export { drawSigmaScale, sigmaLegend, type LegendMark } from "./sigma_scale.ts";
export type { Mode } from "./flat.ts";
export type { Shape } from "./loaded.ts";
export type { View } from "./pose.ts";

/** How a viewer is to behave. */
export interface ViewerOptions {
  /** Nothing moves by itself, and what is asked for is shown at once. */
  readonly reducedMotion: boolean;
  /** It may be looked at from all sides, and not from the front alone. */
  readonly free?: boolean;
  /** Called where there is no WebGL: the face is a picture that cannot be turned. */
  readonly onFlat?: () => void;
}

/** Least time from picture to picture of what turns by itself in software, ms: the processor has other
 * work. */
const SOFTWARE_FRAME_MS = 45;
/** After so long without movement the whole face is drawn, ms. */
const STILL_MS = 160;
/** Longest time by which a movement goes on at once, s: after a pause nothing jumps. */
const MAX_STEP_S = 0.1;
/** Time in which true colours become those of sigma, s. */
const FADE_S = 0.35;
/** What a finger that lets go while moving still turns, s of its speed, at most so many degrees. */
const FLICK_S = 0.18;
const MAX_FLICK = 40;

/**
 * Shows faces on a canvas, whose size in CSS pixels is its own.
 *
 * Draws on demand alone: nothing runs while nothing moves.
 */
export class FaceViewer {
  /** Called when a visitor touches the canvas. */
  onTouched: (() => void) | null = null;
  /** Called after each drawing where the line between dense and initial cloud is, as a part of the
   * canvas's width; null where there is none. */
  onSplit: ((at: number | null) => void) | null = null;
  /** Called when the view has changed, but not by `look`. */
  onView: ((view: View) => void) | null = null;
  /** Sigma at the ends of the colours' scale, mm. */
  readonly sigmaRange = SIGMA_RANGE_MM;
  readonly #canvas: HTMLCanvasElement;
  readonly #still: boolean;
  readonly #graphics: Graphics | null;
  readonly #stage: Stage | null;
  readonly #flat: CanvasRenderingContext2D | null = null;
  readonly #pose: Pose;
  readonly #detail: Detail;
  readonly #ended = new AbortController();
  #face: Shape | null = null;
  #mode: Mode = "mesh";
  #blend = 1;
  #confidence = 0;
  #frame = 0;
  #settle: ReturnType<typeof setTimeout> | undefined;
  #last = 0;
  #ratio = 0;
  /** Whether the next view is this viewer's own. */
  #told = false;

  constructor(canvas: HTMLCanvasElement, { reducedMotion, free, onFlat }: ViewerOptions) {
    this.#canvas = canvas;
    this.#still = reducedMotion;
    this.#pose = new Pose(reducedMotion, free);
    this.#graphics = openGraphics(canvas);
    this.#detail = new Detail(this.#graphics?.software ?? true);
    this.#stage = this.#graphics && new Stage(canvas, this.#graphics.context);
    if (!this.#graphics) {
      this.#flat = canvas.getContext("2d");
      onFlat?.();
    }
    this.#listen();
    this.resize();
  }

  /** Whether the face can be turned: false where there is no WebGL. */
  get rotatable(): boolean {
    return this.#stage !== null;
  }

  /** What is shown of the face. */
  get mode(): Mode {
    return this.#mode;
  }

  set mode(mode: Mode) {
    this.#mode = mode;
    if (this.#still || mode === "points") this.#confidence = Number(mode === "sigma");
    this.#request();
  }

  /** Part of the face, from the left, that is dense: 0 is the initial cloud, 1 the dense face. */
  get blend(): number {
    return this.#blend;
  }

  set blend(blend: number) {
    this.#blend = Math.min(1, Math.max(0, blend));
    this.#request();
  }

  /** Whether all that is to be seen is drawn, and nothing moves. */
  get resting(): boolean {
    return !this.#frame && this.#settle === undefined;
  }

  /** Whether the face turns by itself; a touch ends it. */
  get turning(): boolean {
    return this.#pose.turning;
  }

  set turning(on: boolean) {
    this.#pose.turning = on;
    this.#request();
  }

  /**
   * Shows another face from the front, or as the one before was seen.
   *
   * @param keep whether the view stays.
   * @returns a promise of whether it was drawn: false where another one came first, or the end.
   */
  async show(face: Shape, keep = false): Promise<boolean> {
    this.#face = face;
    if (!keep) this.#pose.reset(true);
    this.#stage?.load(face);
    for (;;) {
      // What comes first is as coarse as what moves: the rest follows.
      this.#draw(false);
      this.#request();
      if (!this.#graphics || await drawn(this.#graphics.context)) return this.#face === face;
      await this.#restored();
      if (this.#face !== face) return false;
    }
  }

  /** Shows nothing, and forgets the face. */
  clear(): void {
    this.#face = null;
    this.#stage?.load(null);
    this.#stage?.wipe();
    this.#flat?.clearRect(0, 0, this.#canvas.width, this.#canvas.height);
  }

  /** Turns by degrees, `dx` to the right, `dy` down, and no more by itself. */
  rotate(dx: number, dy: number): void {
    this.#moved(() => this.#pose.rotate(dx, dy));
  }

  /** Comes nearer by a factor above 1, goes away by one below; turns no more by itself. */
  zoom(factor: number): void {
    this.#moved(() => this.#pose.zoom(factor));
  }

  /** Shows the face from the front again, all of it; it turns no more by itself. */
  reset(): void {
    this.#moved(() => this.#pose.reset());
  }

  /** Takes another viewer's view, at once. */
  look(view: View): void {
    this.#pose.turning = false;
    this.#pose.take(view);
    this.#request();
  }

  /** Draws all of what is seen, to be taken from the canvas in the same task. */
  redraw(): void {
    this.#draw(true);
  }

  /** To be called when the canvas's size in CSS pixels has changed. */
  resize(): void {
    this.#ratio = 0;
    this.#request();
  }

  /** Frees everything; the canvas cannot be used again. */
  dispose(): void {
    this.#ended.abort();
    cancelAnimationFrame(this.#frame);
    clearTimeout(this.#settle);
    this.#face = null;
    this.#stage?.dispose();
  }

  #listen(): void {
    const pose = this.#pose;
    const { signal } = this.#ended;
    listen(this.#canvas, {
      touched: () => {
        this.turning = false;
        this.onTouched?.();
      },
      turn: (yaw, pitch) => {
        // From near, a finger moves over less of the face.
        const part = 1 / Math.max(1, Math.sqrt(pose.view.zoom));
        this.#moved(() => pose.rotate(part * yaw, part * pitch, true));
      },
      flick: (yaw, pitch) => this.#flick(yaw, pitch),
      zoom: (factor) => this.#moved(() => pose.zoom(factor, true)),
      pan: (x, y) => {
        const [across, down] = this.#stage?.partsOfPixel() ?? [0, 0];
        this.#moved(() => pose.pan(x * across, y * down, true));
      },
      reset: () => this.reset(),
    }, signal);
    this.#canvas.addEventListener("webglcontextlost", (event) => event.preventDefault(), { signal });
    this.#canvas.addEventListener("webglcontextrestored", () => this.resize(), { signal });
  }

  /** Waits until the graphics context is there again, or the viewer is disposed of. */
  #restored(): Promise<void> {
    return new Promise((done) => {
      const { signal } = this.#ended;
      if (signal.aborted || !this.#graphics?.context.isContextLost()) done();
      signal.addEventListener("abort", () => done(), { once: true });
      this.#canvas.addEventListener("webglcontextrestored", () => done(), { once: true, signal });
    });
  }

  #moved(change: () => void): void {
    this.#pose.turning = false;
    change();
    this.#told = true;
    this.#request();
  }

  #flick(yaw: number, pitch: number): void {
    if (this.#still) return;
    const part = (speed: number): number =>
      Math.min(MAX_FLICK, Math.max(-MAX_FLICK, speed * FLICK_S));
    this.rotate(part(yaw), part(pitch));
  }

  /** Draws at the browser's next picture. */
  #request(): void {
    if (this.#frame || this.#ended.signal.aborted) return;
    this.#frame = requestAnimationFrame((now) => this.#next(now));
  }

  #next(now: number): void {
    this.#frame = 0;
    const elapsed = this.#last ? now - this.#last : 0;
    if (elapsed && elapsed < SOFTWARE_FRAME_MS && this.turning && this.#graphics?.software) {
      this.#request();
      return;
    }
    clearTimeout(this.#settle);
    this.#settle = undefined;
    if (elapsed) this.#detail.took(elapsed);
    const seconds = Math.min(MAX_STEP_S, (elapsed || 16) / 1000);
    const moving = this.#pose.step(seconds) && !this.#flat;  // a flat picture is of the front
    if (this.#told) this.onView?.(this.#pose.view);
    this.#told = moving;
    const fading = this.#fade(seconds);
    this.#draw(false);
    if (moving || fading) {
      this.#last = now;
      this.#request();
      return;
    }
    this.#last = 0;
    this.#detail.rest();
    this.#settle = setTimeout(() => {
      this.#settle = undefined;
      this.#draw(true);
    }, STILL_MS);
  }

  /** Goes on from one mode's colours to the other's; returns whether it is not there yet. */
  #fade(seconds: number): boolean {
    const wanted = Number(this.#mode === "sigma");
    const left = wanted - this.#confidence;
    const step = seconds / FADE_S;
    this.#confidence = Math.abs(left) <= step ? wanted : this.#confidence + Math.sign(left) * step;
    return this.#confidence !== wanted;
  }

  /** Draws all of what stands still, and what leaves it smooth of what moves. */
  #draw(still: boolean): void {
    const { clientWidth: width, clientHeight: height } = this.#canvas;
    if (!this.#face || width === 0 || height === 0) return;
    const software = this.#graphics?.software ?? false;
    const ratio = pixelRatio(width, height, devicePixelRatio, software, still);
    if (this.#flat) {
      this.#canvas.width = Math.round(width * ratio);
      this.#canvas.height = Math.round(height * ratio);
      if (!isMesh(this.#face)) drawFlat(this.#flat, this.#face, this.#mode, this.#blend);
      this.onSplit?.(null);
      return;
    }
    if (!this.#stage || this.#graphics?.context.isContextLost()) return;
    if (ratio !== this.#ratio) {
      this.#stage.resize(width, height, ratio);
      this.#ratio = ratio;
    }
    const smooth = this.#confidence * this.#confidence * (3 - 2 * this.#confidence);
    const split = this.#stage.draw({
      view: this.#pose.view, mode: this.#mode, confidence: smooth, blend: this.#blend,
      stride: still ? 1 : this.#detail.stride,
    });
    this.onSplit?.(split);
  }
}
