/** Colours of the confidence view: from sure to unsure, told apart by colour-blind people too. */

/** Sigma at both ends of the scale, mm. Fixed, so that two faces can be compared. */
export const SIGMA_RANGE_MM: readonly [number, number] = [0.5, 4];

/** A mark of the legend. */
export interface LegendMark {
  /** Sigma, mm. */
  readonly mm: number;
  /** Where on the scale: 0 to 1. */
  readonly at: number;
  /** CSS colour. */
  readonly color: string;
}

/** Of "viridis" by S. van der Walt and N. Smith (CC0), at even distances; its lightness rises
 * evenly, so that it is read without hue. sRGB. */
const VIRIDIS: readonly (readonly [number, number, number])[] = [
  [70, 50, 127], [61, 78, 138], [49, 104, 142], [39, 127, 142], [31, 150, 139], [45, 178, 125],
  [92, 200, 99], [160, 218, 57], [253, 231, 37],
];

/** Where sigma, mm, lies on the scale: 0 to 1, even in its logarithm. */
export function sigmaPosition(mm: number): number {
  const [low, high] = SIGMA_RANGE_MM;
  return Math.min(1, Math.max(0, Math.log(mm / low) / Math.log(high / low)));
}

/** The colour at a place of the scale, 0 to 1: red, green, blue, 0 to 255, sRGB. */
export function sigmaColor(at: number): [number, number, number] {
  const place = Math.min(1, Math.max(0, at)) * (VIRIDIS.length - 1);
  const low = Math.min(VIRIDIS.length - 2, Math.floor(place));
  const part = place - low;
  const mixed = (channel: 0 | 1 | 2): number =>
    Math.round(VIRIDIS[low]![channel] * (1 - part) + VIRIDIS[low + 1]![channel] * part);
  return [mixed(0), mixed(1), mixed(2)];
}

/** The legend's marks: at each doubling. What is beyond the ends has the ends' colour. */
export function sigmaLegend(): LegendMark[] {
  const marks: LegendMark[] = [];
  for (let mm = SIGMA_RANGE_MM[0]; mm <= SIGMA_RANGE_MM[1]; mm *= 2) {
    const at = sigmaPosition(mm);
    marks.push({ mm, at, color: `rgb(${sigmaColor(at).join(" ")})` });
  }
  return marks;
}

/** Draws the scale from left to right, over the whole of a canvas. */
export function drawSigmaScale(canvas: HTMLCanvasElement): void {
  const context = canvas.getContext("2d");
  if (!context) return;
  const { width, height } = canvas;
  for (let x = 0; x < width; x++) {
    context.fillStyle = `rgb(${sigmaColor((x + 0.5) / width).join(" ")})`;
    context.fillRect(x, 0, 1, height);
  }
}
