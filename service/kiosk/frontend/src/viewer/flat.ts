/** A face as a plain picture, where the browser has no WebGL: front view alone. */

import { sigmaOf, type FaceGrid } from "../face_grid.ts";
import { sigmaColor, sigmaPosition } from "./sigma_scale.ts";

/** What of a face is shown. */
export type Mode = "mesh" | "points" | "sigma";

/** Part of a canvas's sides that the face takes. */
const SHARE = 0.86;
/** Every so many-th row and column is a dot. */
const DOTS = 4;

/** Draws a face's front view over a canvas; `split` is the part of its width that shows the initial
 * cloud. */
export function drawFlat(
  context: CanvasRenderingContext2D, face: FaceGrid, mode: Mode, split: number,
): void {
  const { width, height } = context.canvas;
  const scale = SHARE * Math.min(width / face.columns, height / face.rows);
  const left = (width - face.columns * scale) / 2;
  const top = (height - face.rows * scale) / 2;
  context.clearRect(0, 0, width, height);
  clipped(context, split * width, width, () => {
    const picture = document.createElement("canvas");
    picture.width = face.columns;
    picture.height = face.rows;
    picture.getContext("2d")?.putImageData(pixels(face, mode), 0, 0);
    context.imageSmoothingQuality = "high";
    context.drawImage(picture, left, top, face.columns * scale, face.rows * scale);
  });
  clipped(context, 0, split * width, () => {
    const { positions, colors, points } = face.seeds;
    const side = Math.max(1, 0.7 * face.spacingMm / face.stepMm * scale);
    for (let point = 0; point < points; point++) {
      const x = left + (positions[3 * point]! - face.leftMm) / face.stepMm * scale;
      const y = top + (positions[3 * point + 1]! - face.topMm) / face.stepMm * scale;
      context.fillStyle = `rgb(${colors.subarray(3 * point, 3 * point + 3).join(" ")})`;
      context.fillRect(x - side / 2, y - side / 2, side, side);
    }
  });
}

function clipped(
  context: CanvasRenderingContext2D, from: number, to: number, draw: () => void,
): void {
  if (to <= from) return;
  context.save();
  context.beginPath();
  context.rect(from, 0, to - from, context.canvas.height);
  context.clip();
  draw();
  context.restore();
}

function pixels(face: FaceGrid, mode: Mode): ImageData {
  const { rows, columns, places, colors } = face;
  const image = new ImageData(columns, rows);
  const scale = Array.from({ length: 256 }, (_, code) =>
    sigmaColor(sigmaPosition(sigmaOf(code, face.sigmaMm))));
  for (let point = 0; point < places.length; point++) {
    const place = places[point]!;
    const row = Math.floor(place / columns);
    if (mode === "points" && (row % DOTS >= DOTS / 2 || place % columns % DOTS >= DOTS / 2)) continue;
    image.data.set(mode === "sigma" ? scale[colors[4 * point + 3]!]!
      : colors.subarray(4 * point, 4 * point + 3), 4 * place);
    image.data[4 * place + 3] = 255;
  }
  return image;
}
