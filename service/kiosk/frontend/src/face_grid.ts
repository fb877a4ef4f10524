/**
 * Reads a face's grid: the dense face and its initial cloud as the service sends them to browsers.
 * The format is described in `docs/wire.md`, "A face for browsers". Needs no other module; runs in
 * browsers and under node.
 */

/** A dense face on its grid, in the depth camera's frame: x right, y down, z forward; mm. */
export interface FaceGrid {
  readonly rows: number;
  readonly columns: number;
  /** x of the first column, mm. */
  readonly leftMm: number;
  /** y of the first row, mm. */
  readonly topMm: number;
  /** Distance of neighbouring columns, and rows, mm. */
  readonly stepMm: number;
  /** Mean distance of neighbouring points of the initial cloud, mm. */
  readonly spacingMm: number;
  /** Number of points. */
  readonly points: number;
  /** (rows * columns): which point is at a place, row by row; -1 where there is none. */
  readonly index: Int32Array;
  /** (points): the place of each point, `row * columns + column`, ascending. */
  readonly places: Uint32Array;
  /** (points): depth, mm. */
  readonly z: Float32Array;
  /** (points * 4): red, green, blue (sRGB), and the code of sigma: see `sigmaOf`. */
  readonly colors: Uint8Array;
  /** Sigma of codes 0 and 255, mm. */
  readonly sigmaMm: readonly [number, number];
  readonly seeds: Seeds;
}

/** The initial cloud: what was measured. */
export interface Seeds {
  readonly points: number;
  /** (points * 3): x, y, z, mm. */
  readonly positions: Float32Array;
  /** (points * 3): red, green, blue (sRGB). */
  readonly colors: Uint8Array;
}

/** What was given is no face's grid, or a damaged one; the message says what is wrong. */
export class FaceGridError extends Error {
  override readonly name = "FaceGridError";
}

const MAGIC = 0x52474644; // "DFGR", read as little-endian
const VERSION = 1;
const PREFIX_BYTES = 12;
const MAX_HEADER_BYTES = 4096;
const MAX_PLACES = 2 ** 25;
const MAX_SEEDS = 2 ** 22;
/** Units beyond which a coordinate is refused, so that no sum overflows. */
const REACH = 2 ** 28;
/** Stands in the bytes for a residual that has 32 bits of its own. */
const LONG = 255;
/** deflate gives at most so many bytes for one. */
const MAX_DEFLATE_RATIO = 1032;

/**
 * Sigma of a code, mm: the codes are even in its logarithm.
 *
 * @param code 0 to 255, the fourth byte of a point's colour.
 */
export function sigmaOf(code: number, [low, high]: readonly [number, number]): number {
  return low * (high / low) ** (code / 255);
}

/**
 * Reads a face's grid.
 *
 * @throws FaceGridError where the bytes are none; nothing is allocated for a claim that the bytes
 * cannot hold.
 */
export async function decodeFaceGrid(bytes: Uint8Array): Promise<FaceGrid> {
  const { header, packed } = split(bytes);
  const { rows, columns, points, seeds } = header;
  const supportBytes = rows * Math.ceil(columns / 8);
  const length = supportBytes + 5 * points + 4 * header.long + 6 * seeds + 4 * header.longOfSeeds;
  if (length > MAX_DEFLATE_RATIO * packed.length) {
    throw new FaceGridError(`${length} bytes are claimed, ${packed.length} packed ones are there`);
  }
  const body = await inflate(packed, length);
  let at = 0;
  const take = (size: number): Uint8Array => body.subarray(at, (at += size));

  const { index, places } = readSupport(take(supportBytes), rows, columns, points);
  const depths = take(points);
  const channels = [take(points), take(points), take(points), take(points)] as const;
  const longDepths = new Longs(take(4 * header.long));
  const z = readDepths(depths, longDepths, index, places, columns, header.unitMm);
  const colors = readBytes(channels, index, places, columns);
  const ways = take(3 * seeds);
  const seedColors = take(3 * seeds);
  const longWays = new Longs(take(4 * header.longOfSeeds));
  return {
    rows, columns, points, index, places, z, colors,
    leftMm: header.leftMm, topMm: header.topMm, stepMm: header.stepMm,
    spacingMm: header.spacingMm, sigmaMm: header.sigmaMm,
    seeds: readSeeds(ways, seedColors, longWays, seeds, header.unitMm),
  };
}

interface Header {
  rows: number;
  columns: number;
  points: number;
  long: number;
  seeds: number;
  longOfSeeds: number;
  leftMm: number;
  topMm: number;
  stepMm: number;
  spacingMm: number;
  unitMm: number;
  sigmaMm: [number, number];
}

/** Gives the checked header and what follows it. */
function split(bytes: Uint8Array): { header: Header; packed: Uint8Array } {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < PREFIX_BYTES || view.getUint32(0, true) !== MAGIC) {
    throw new FaceGridError("these bytes are no face's grid");
  }
  const version = view.getUint32(4, true);
  if (version !== VERSION) throw new FaceGridError(`version ${version}, expected ${VERSION}`);
  const length = view.getUint32(8, true);
  if (length > MAX_HEADER_BYTES || length > bytes.length - PREFIX_BYTES) {
    throw new FaceGridError(`a header of ${length} bytes does not fit`);
  }
  const end = PREFIX_BYTES + length;
  let said: unknown;
  try {
    const text = new TextDecoder("utf-8", { fatal: true }).decode(bytes.subarray(PREFIX_BYTES, end));
    said = JSON.parse(text);
  } catch {
    throw new FaceGridError("the header is no JSON");
  }
  if (typeof said !== "object" || said === null) throw new FaceGridError("the header is no object");
  return { header: checked(said as Record<string, unknown>), packed: bytes.subarray(end) };
}

function checked(said: Record<string, unknown>): Header {
  const number = (name: string, value: unknown, low: number, high: number): number => {
    if (typeof value !== "number" || !(value >= low && value <= high)) {
      throw new FaceGridError(`${name} is ${JSON.stringify(value)}, expected ${low} to ${high}`);
    }
    return value;
  };
  const whole = (name: string, low: number, high: number): number => {
    const value = number(name, said[name], low, high);
    if (!Number.isInteger(value)) throw new FaceGridError(`${name} is ${value}, no whole number`);
    return value;
  };
  const length = (name: string, low: number): number => number(name, said[name], low, 1e7);
  const rows = whole("rows", 1, MAX_PLACES);
  const columns = whole("columns", 1, Math.floor(MAX_PLACES / rows));
  const points = whole("points", 0, rows * columns);
  const seeds = whole("seeds", 0, MAX_SEEDS);
  const sigma = said["sigma_mm"];
  if (!Array.isArray(sigma) || sigma.length !== 2) throw new FaceGridError("sigma_mm is no range");
  const low = number("sigma_mm", sigma[0], 1e-6, 1e7);
  const high = number("sigma_mm", sigma[1], low, 1e7);
  return {
    rows, columns, points, seeds,
    long: whole("long", 0, points),
    longOfSeeds: whole("long_of_seeds", 0, 3 * seeds),
    leftMm: length("left_mm", -1e7), topMm: length("top_mm", -1e7),
    stepMm: length("step_mm", 1e-6), spacingMm: length("spacing_mm", 1e-6),
    unitMm: length("unit_mm", 1e-6), sigmaMm: [low, high],
  };
}

/** Unpacks a zlib stream that must have `length` bytes. */
async function inflate(packed: Uint8Array, length: number): Promise<Uint8Array> {
  const body = new Uint8Array(length);
  const source = new ReadableStream<BufferSource>({
    start(controller) {
      controller.enqueue(packed as Uint8Array<ArrayBuffer>);
      controller.close();
    },
  });
  const reader = source.pipeThrough(new DecompressionStream("deflate")).getReader();
  let at = 0;
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      if (at + value.length > length) {
        throw new FaceGridError(`the body has more than the ${length} bytes of its header`);
      }
      body.set(value, at);
      at += value.length;
    }
  } catch (error) {
    if (error instanceof FaceGridError) throw error;
    throw new FaceGridError("the body is cut off or damaged");
  } finally {
    reader.cancel().catch(() => undefined);
  }
  if (at !== length) throw new FaceGridError(`the body has ${at} bytes, its header says ${length}`);
  return body;
}

/** Residuals that did not fit into a byte, in their order. */
class Longs {
  readonly #view: DataView;
  #at = 0;

  constructor(bytes: Uint8Array) {
    this.#view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  }

  next(): number {
    if (this.#at >= this.#view.byteLength) {
      throw new FaceGridError("there are more long residuals than the header says");
    }
    const folded = this.#view.getUint32(this.#at, true);
    this.#at += 4;
    return folded;
  }

  end(): void {
    if (this.#at !== this.#view.byteLength) {
      throw new FaceGridError("there are fewer long residuals than the header says");
    }
  }
}

/** 0, 1, 2, 3, 4 stand for 0, -1, 1, -2, 2. */
function unfolded(folded: number): number {
  return (folded >>> 1) ^ -(folded & 1);
}

function near(units: number): number {
  if (!(Math.abs(units) <= REACH)) throw new FaceGridError("a coordinate is too far away");
  return units;
}

function readSupport(
  bits: Uint8Array, rows: number, columns: number, points: number,
): { index: Int32Array; places: Uint32Array } {
  const wrong = new FaceGridError(`the support has not ${points} places within its columns`);
  const index = new Int32Array(rows * columns).fill(-1);
  const places = new Uint32Array(points);
  const stride = Math.ceil(columns / 8);
  let n = 0;
  for (let row = 0; row < rows; row++) {
    for (let group = 0; group < stride; group++) {
      const byte = bits[row * stride + group]!;
      if (byte === 0) continue;
      for (let bit = 0; bit < 8; bit++) {
        if ((byte & (128 >> bit)) === 0) continue;
        const column = 8 * group + bit;
        if (column >= columns || n === points) throw wrong;
        const place = row * columns + column;
        index[place] = n;
        places[n++] = place;
      }
    }
  }
  if (n !== points) throw wrong;
  return { index, places };
}

/** What `forEachPoint` says of a point's neighbours. */
type Visit = (point: number, left: number, above: number, corner: number) => void;

/** Visits the points in order with their left, upper and upper left neighbour, -1 for none. */
function forEachPoint(
  index: Int32Array, places: Uint32Array, columns: number, visit: Visit,
): void {
  for (let point = 0; point < places.length; point++) {
    const place = places[point]!;
    const inner = place % columns > 0;
    const left = inner ? index[place - 1]! : -1;
    const above = place >= columns ? index[place - columns]! : -1;
    const corner = inner && place > columns ? index[place - columns - 1]! : -1;
    visit(point, left, above, corner);
  }
}

function readDepths(
  short: Uint8Array, longs: Longs, index: Int32Array, places: Uint32Array, columns: number,
  unitMm: number,
): Float32Array {
  const units = new Int32Array(places.length);
  const z = new Float32Array(places.length);
  forEachPoint(index, places, columns, (point, left, above, corner) => {
    const expected = left >= 0
      ? above >= 0 && corner >= 0 ? units[left]! + units[above]! - units[corner]! : units[left]!
      : above >= 0 ? units[above]! : 0;
    const byte = short[point]!;
    const residual = unfolded(byte === LONG ? longs.next() : byte);
    units[point] = near(expected + residual);
    z[point] = units[point]! * unitMm;
  });
  longs.end();
  return z;
}

/** Reads four channels of bytes into one array, interleaved. */
function readBytes(
  channels: readonly [Uint8Array, Uint8Array, Uint8Array, Uint8Array], index: Int32Array,
  places: Uint32Array, columns: number,
): Uint8Array {
  const [a, b, c, d] = channels;
  const out = new Uint8Array(4 * places.length); // sums wrap around as they are stored
  forEachPoint(index, places, columns, (point, left, above, corner) => {
    const at = 4 * point;
    out[at] = a[point]!;
    out[at + 1] = b[point]!;
    out[at + 2] = c[point]!;
    out[at + 3] = d[point]!;
    if (left >= 0) {
      for (let k = 0; k < 4; k++) out[at + k]! += out[4 * left + k]!;
      if (above >= 0 && corner >= 0) {
        for (let k = 0; k < 4; k++) out[at + k]! += out[4 * above + k]! - out[4 * corner + k]!;
      }
    } else if (above >= 0) {
      for (let k = 0; k < 4; k++) out[at + k]! += out[4 * above + k]!;
    }
  });
  return out;
}

function readSeeds(
  ways: Uint8Array, steps: Uint8Array, longs: Longs, points: number, unitMm: number,
): Seeds {
  const positions = new Float32Array(3 * points);
  const colors = new Uint8Array(3 * points);
  for (let axis = 0; axis < 3; axis++) {
    let units = 0;
    let level = 0;
    for (let point = 0; point < points; point++) {
      const byte = ways[axis * points + point]!;
      units = near(units + unfolded(byte === LONG ? longs.next() : byte));
      positions[3 * point + axis] = units * unitMm;
      level += steps[axis * points + point]!;
      colors[3 * point + axis] = level;
    }
  }
  longs.end();
  return { points, positions, colors };
}
