/** A picture of what is seen, as a file. */
import { drawSigmaScale, sigmaLegend } from "../viewer/viewer.ts";
import type { Stages } from "./stages.ts";

const GROUND = "#15121a";
const INK = "#f7f1e8";
/** Of the legend, in CSS pixels: margin, width and height of its scale, size of letters. */
const MARGIN = 16;
const SCALE = [280, 12] as const;
const LETTERS = 14;

/** Draws all pictures as they stand on the page, with their names, and the legend of certainty. */
export function picture(stages: Stages, legend: string): HTMLCanvasElement {
  const ratio = Math.max(1, devicePixelRatio);
  const whole = stages.element.getBoundingClientRect();
  const canvas = document.createElement("canvas");
  canvas.width = Math.round(whole.width * ratio);
  canvas.height = Math.round(whole.height * ratio);
  const context = canvas.getContext("2d");
  if (!context) throw new TypeError("this browser draws no pictures");
  context.scale(ratio, ratio);
  context.fillStyle = GROUND;
  context.fillRect(0, 0, whole.width, whole.height);
  context.font = `${LETTERS}px system-ui, sans-serif`;
  for (const { viewer, canvas: from, picture: frame, looked, element } of stages.all) {
    const at = (looked?.shape ? from : element).getBoundingClientRect();
    const [left, top] = [at.left - whole.left, at.top - whole.top];
    if (looked?.shape) {
      viewer.redraw();
      context.drawImage(from, left, top, at.width, at.height);
    } else if (frame.naturalWidth > 0) {
      const scale = Math.min(at.width / frame.naturalWidth, at.height / frame.naturalHeight);
      const [width, height] = [scale * frame.naturalWidth, scale * frame.naturalHeight];
      context.drawImage(frame, left + (at.width - width) / 2, top + (at.height - height) / 2, width,
        height);
    }
    context.fillStyle = INK;
    context.fillText(looked?.seen.title ?? "", left + MARGIN, top + MARGIN + LETTERS,
      at.width - 2 * MARGIN);
  }
  if (stages.viewer.mode === "sigma") drawLegend(context, legend, whole.height);
  return canvas;
}

function drawLegend(context: CanvasRenderingContext2D, text: string, height: number): void {
  const scale = document.createElement("canvas");
  [scale.width, scale.height] = [256, 1];
  drawSigmaScale(scale);
  const [width, high] = SCALE;
  const top = height - MARGIN - high - 1.5 * LETTERS;
  context.fillText(text, MARGIN, top - LETTERS / 2);
  context.drawImage(scale, MARGIN, top, width, high);
  context.textAlign = "center";
  for (const { mm, at } of sigmaLegend()) {
    context.fillText(`${mm}`, MARGIN + at * width, top + high + 1.2 * LETTERS);
  }
  context.textAlign = "start";
  context.fillText("mm", MARGIN + width + LETTERS, top + high + 1.2 * LETTERS);
}

/** Hands a picture over as a file. */
export async function save(canvas: HTMLCanvasElement, name: string): Promise<void> {
  const blob = await new Promise<Blob | null>((done) => canvas.toBlob(done, "image/png"));
  if (!blob) throw new TypeError("there is no picture");
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

/** A file's name of a title: no folder, nothing odd, and not the ending of what is shown. */
export function fileName(title: string): string {
  const last = (title.split(/[\\/]/).pop() ?? "").replace(/\.[a-z]{3}(?=,|$)/, "");
  return `${last.replace(/[^\p{L}\p{N}._-]+/gu, "_").replace(/^[._]+/, "") || "face"}.png`;
}
