/** The words of this page: it is English alone, as the command that shows it. Those of the viewer's
 * buttons and of measurements are the kiosk's. */

export const WORDS = {
  files: "Files",
  view: "View",
  about: "About it",
  save: "Save a picture",
  beside: "Beside the others",
  refused: "The frame, with what looked like a face",
  noMesh: "This browser has no WebGL: a mesh cannot be shown.",
  frame: "Frame",
  frames: "Frames",
  previous: "Previous frame",
  next: "Next frame",
  warnings: "Warnings",
  measurements: "Measurements",
  figures: "Figures",
  provenance: "Where it comes from",
  wholeReport: "All of the report",
  report: "Report",
  keys: "Keys",
  ended: "denseface view has ended: start it again, and open its new address.",
} as const;

/** What keys do: keys, divided by spaces, and what. */
export const KEYS: readonly (readonly [string, string])[] = [
  ["Arrows", "turn"], ["+ -", "zoom"], ["0", "view from the front"],
  ["1 2 3", "surface, points, certainty"], ["B", "measured or dense"],
  ["N P", "next, previous frame"], ["S", "save a picture"],
];

/** While one waits for an item's frame. */
export function busy(name: string, made: boolean): string {
  return `${made ? "Reconstructing" : "Reading"} ${name} …`;
}

/** One frame of an item of several. */
export function numbered(name: string, frame: number): string {
  return `${name}, frame ${frame}`;
}

/** Where a frame is among all. */
export function placed(frame: number, frames: number | null): string {
  return frames === null ? `Frame ${frame}` : `Frame ${frame} of 0 to ${frames - 1}`;
}

/** What a picture is, and how it is turned. */
export function described(title: string): string {
  return `${title}. Arrow keys turn it, + and - zoom, 0 shows its front.`;
}

/** The label of what shows an item beside the others. */
export function besideOthers(name: string): string {
  return `Show ${name} beside the others`;
}

/** What a picture was saved as. */
export function saved(name: string): string {
  return `Saved as ${name}`;
}
