/** How a face is turned, near and placed, and how that moves: limits so that nobody gets lost. */

/** Turned by so much, seen so near, moved by so much. */
export interface View {
  /** About the vertical, degrees; positive turns the face to the viewer's right. */
  yaw: number;
  /** About the horizontal, degrees; positive tilts the face down. */
  pitch: number;
  /** 1 shows all of the face. */
  zoom: number;
  /** Parts of the face's half width and half height. */
  panX: number;
  panY: number;
}

const MAX_YAW = 75;
const MAX_PITCH = 50;
/** Where a shape may be looked at from everywhere: over its top one is lost. */
const FREE_PITCH = 89;
const MIN_ZOOM = 0.7;
const MAX_ZOOM = 6;
/** Greatest angle and time of a whole swing of the pendulum: a face has no back to turn to. */
const SWING = 35;
const SWING_S = 14;
/** A nod goes along with the swing, degrees. */
const NOD = 3;
/** After so long what was asked for is reached but for 37 %. */
const EASE_S = 0.11;
/** Differences too small to be seen: degrees, and parts. */
const SETTLED_DEG = 0.05;
const SETTLED = 0.001;

const clamp = (value: number, low: number, high: number): number =>
  Math.min(high, Math.max(low, value));

/** The view of a face, which moves toward what is asked for. */
export class Pose {
  /** What is shown. */
  readonly view: View = { yaw: 0, pitch: 0, zoom: 1, panX: 0, panY: 0 };
  readonly #wanted: View = { ...this.view };
  readonly #still: boolean;
  readonly #free: boolean;
  #turning = false;
  #phase = 0;

  /**
   * @param still whether what is asked for is shown at once, and nothing turns by itself.
   * @param free whether it may be looked at from all sides.
   */
  constructor(still: boolean, free = false) {
    this.#still = still;
    this.#free = free;
  }

  get turning(): boolean {
    return this.#turning;
  }

  /** Whether the face turns by itself, to and fro; it goes on from where it is. */
  set turning(on: boolean) {
    if (on === this.#turning || (on && this.#still)) return;
    this.#turning = on;
    if (on) {
      this.#phase = Math.asin(clamp(this.view.yaw / SWING, -1, 1));
      this.#want({ ...this.#wanted, zoom: 1, panX: 0, panY: 0 });
    } else {
      this.#want(this.view);
    }
  }

  /** Turns by degrees: at once under a finger, else smoothly. */
  rotate(yaw: number, pitch: number, direct = false): void {
    const wanted = this.#wanted;
    this.#want({ ...wanted, yaw: wanted.yaw + yaw, pitch: wanted.pitch + pitch }, direct);
  }

  /** Comes nearer by a factor. */
  zoom(factor: number, direct = false): void {
    if (!(factor > 0)) return;
    this.#want({ ...this.#wanted, zoom: this.#wanted.zoom * factor }, direct);
  }

  /** Moves by parts of the face's half width and height. */
  pan(x: number, y: number, direct = false): void {
    const wanted = this.#wanted;
    this.#want({ ...wanted, panX: wanted.panX + x, panY: wanted.panY + y }, direct);
  }

  /** Takes another one's view, at once. */
  take(view: View): void {
    this.#want(view, true);
  }

  /** Back to the front view; at once for a new face. */
  reset(direct = false): void {
    this.#phase = 0;
    // The short way, after however many turns.
    this.view.yaw -= 360 * Math.round(this.view.yaw / 360);
    this.#want({ yaw: 0, pitch: 0, zoom: 1, panX: 0, panY: 0 }, direct);
  }

  /**
   * Goes on by a time.
   *
   * @returns whether it still moves.
   */
  step(seconds: number): boolean {
    const { view } = this;
    if (this.#turning) {
      this.#phase += seconds * 2 * Math.PI / SWING_S;
      this.#wanted.yaw = SWING * Math.sin(this.#phase);
      this.#wanted.pitch = NOD * Math.sin(2 * this.#phase);
    }
    const part = this.#still ? 1 : 1 - Math.exp(-seconds / EASE_S);
    let moving = this.#turning;
    for (const name of ["yaw", "pitch", "zoom", "panX", "panY"] as const) {
      const left = this.#wanted[name] - view[name];
      const small = name === "yaw" || name === "pitch" ? SETTLED_DEG : SETTLED;
      if (Math.abs(left) <= small) {
        view[name] = this.#wanted[name];
      } else {
        view[name] += left * part;
        moving ||= part < 1;
      }
    }
    return moving;
  }

  get #most(): number {
    return this.#free ? FREE_PITCH : MAX_PITCH;
  }

  #want(view: View, direct = false): void {
    const zoom = clamp(view.zoom, MIN_ZOOM, MAX_ZOOM);
    // All of the face is in sight at zoom 1; nearer, its rim may come to the middle.
    const reach = Math.max(0, 1 - 1 / zoom);
    Object.assign(this.#wanted, {
      yaw: this.#free ? view.yaw : clamp(view.yaw, -MAX_YAW, MAX_YAW),
      pitch: clamp(view.pitch, -this.#most, this.#most),
      zoom,
      panX: clamp(view.panX, -reach, reach),
      panY: clamp(view.panY, -reach, reach),
    });
    if (direct) Object.assign(this.view, this.#wanted);
  }
}
