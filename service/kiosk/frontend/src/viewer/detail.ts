/** How much is drawn while a face moves: as much as leaves the movement smooth. */

/** Finest and coarsest: every point, or every third row and column. */
const FINEST = 1;
const COARSEST = 3;
/** A frame that takes longer looks jerky, ms. */
const SLOW_MS = 70;
/** A frame that takes less leaves time for four times as much, ms. */
const QUICK_MS = 14;
/** Frames over which is judged. */
const FRAMES = 8;

/** Pixels for each CSS pixel, at most. */
const MAX_RATIO = 2;
/** Pixels of a canvas, at most: by a graphics card, and by a processor while it moves and when it
 * stands. */
const MAX_PIXELS = { card: 6e6, moving: 1.1e6, still: 2.5e6 };
/** A processor does not smooth edges: what stands still is drawn larger instead. */
const SOFTWARE_STILL_RATIO = 1.5;

/**
 * How many pixels are drawn for each CSS pixel.
 *
 * @param width of the canvas, CSS pixels, as its height
 * @param device what the screen has
 * @param software whether a processor computes pixels
 * @param still whether nothing moves
 */
export function pixelRatio(
  width: number, height: number, device: number, software: boolean, still: boolean,
): number {
  const wanted = !software ? Math.min(MAX_RATIO, device) : still ? SOFTWARE_STILL_RATIO : 1;
  const most = !software ? MAX_PIXELS.card : still ? MAX_PIXELS.still : MAX_PIXELS.moving;
  return Math.min(wanted, Math.sqrt(most / (width * height)));
}

/** Chooses the stride of what is drawn while it moves, by the time that frames take. */
export class Detail {
  #stride: number;
  /** Strides below were too slow. */
  #least = FINEST;
  #times: number[] = [];

  /** @param software whether pixels are computed by the processor. */
  constructor(software: boolean) {
    this.#stride = software ? 2 : FINEST;
  }

  /** 1 for every point, 2 for every second row and column, and so on. */
  get stride(): number {
    return this.#stride;
  }

  /** Takes the time from one moving frame to the next, ms. */
  took(ms: number): void {
    this.#times.push(ms);
    if (this.#times.length < FRAMES) return;
    const middle = this.#times.sort((a, b) => a - b)[FRAMES / 2]!;
    this.#times = [];
    if (middle > SLOW_MS && this.#stride < COARSEST) {
      this.#stride += 1;
      this.#least = this.#stride;
    } else if (middle < QUICK_MS && this.#stride > this.#least) {
      this.#stride -= 1;
    }
  }

  /** A movement ended: the time until the next frame says nothing. */
  rest(): void {
    this.#times = [];
  }
}
