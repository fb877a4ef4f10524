/** Pictures on buttons and for hints: strokes on a field of 24 x 24. */
import { svg } from "./dom.ts";

const PATHS = {
  left: "M20 12H5m6-7-7 7 7 7",
  right: "M4 12h15m-6-7 7 7-7 7",
  up: "M12 20V5M5 11l7-7 7 7",
  down: "M12 4v15m-7-6 7 7 7-7",
  closer: "M9 9 3.5 3.5M9 4.5V9H4.5M15 9l5.5-5.5M15 4.5V9h4.5M9 15l-5.5 5.5M9 19.5V15H4.5M15 15l5.5 5.5M15 19.5V15h4.5",
  back: "M3.5 3.5 9 9M3.5 8V3.5H8M20.5 3.5 15 9m1-5.5h4.5V8M3.5 20.5 9 15m-5.5 1v4.5H8M20.5 20.5 15 15m1 5.5h4.5V16",
  turnLeft: "M4 12a8 8 0 1 1 2.4 5.700M4 6v6h6",
  turnRight: "M20 12a8 8 0 1 0-2.4 5.700M20 6v6h-6",
  turnUp: "M6 15l6-6 6 6",
  turnDown: "M6 9l6 6 6-6",
  plus: "M12 5v14M5 12h14",
  minus: "M5 12h14",
  reset: "M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5M12 9.5a2.5 2.5 0 1 0 0 5 2.5 2.5 0 0 0 0-5z",
  check: "M4 13l5.5 5.5L20 7",
  cross: "M6 6l12 12M18 6 6 18",
  camera: "M4 8h3.5L9 5.5h6L16.5 8H20v11H4zM12 10a3.2 3.2 0 1 0 0 6.4 3.2 3.2 0 0 0 0-6.4z",
  again: "M20 11a8 8 0 1 0-1 5M20 4v7h-7",
  keep: "M12 4v11m-5-5 5 5 5-5M5 20h14",
  bin: "M4 7h16M9.5 7V4h5v3M6.5 7l1 13h9l1-13M10.5 11v5.5M13.5 11v5.5",
  speaker: "M4 9.5v5h4l5 4.5V5L8 9.5zM16 9a4.5 4.5 0 0 1 0 6M18.5 6.5a8 8 0 0 1 0 11",
  silent: "M4 9.5v5h4l5 4.5V5L8 9.5zM16.5 9.5l5 5M21.5 9.5l-5 5",
  ruler: "M3 8.5h18v7H3zM7 8.5v3M11 8.5v4M15 8.5v3M19 8.5v4",
  face: "M12 3c4.5 0 7 3 7 7.5 0 5.5-3.5 10.5-7 10.5S5 16 5 10.5C5 6 7.5 3 12 3zM9 10.5v.5M15 10.5v.5M9.5 15.5c1.600 1.300 3.4 1.300 5 0",
  light: "M12 8a4 4 0 1 0 0 8 4 4 0 0 0 0-8zM12 2.5v2M12 19.5v2M2.5 12h2M19.5 12h2M5.300 5.300l1.4 1.4M17.300 17.300l1.4 1.4M5.300 18.700l1.4-1.4M17.300 6.700l1.4-1.4",
  still: "M7 12.5V6.800a1.5 1.5 0 0 1 3 0V11 5a1.5 1.5 0 0 1 3 0v6-4.800a1.5 1.5 0 0 1 3 0V12l.2-1.5a1.5 1.5 0 0 1 3 .3L18 16.5c-.7 2.800-2.700 4.5-5.5 4.5-2.4 0-4-1-5.2-3L4.5 13.4a1.5 1.5 0 0 1 2.5-1.5z",
  people: "M9 5a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM3 20c0-4 2.5-6.5 6-6.5s6 2.5 6 6.5M15.5 5.300a3 3 0 0 1 0 5.4M17.5 14c2.2.9 3.5 3 3.5 6",
  gone: "M4 8h3.5L9 5.5h6L16.5 8H20v11H4zM3 3l18 18",
  beside: "M4 5h7v14H4zM13 5h7v14h-7z",
  clock: "M12 4a8 8 0 1 0 0 16 8 8 0 0 0 0-16zM12 8v4.5l3 2",
} as const;

export type IconName = keyof typeof PATHS;

/** A picture that is not read out: what stands beside it or its button's label is. */
export function icon(name: IconName): SVGSVGElement {
  return svg("svg", { class: "icon", viewBox: "0 0 24 24", "aria-hidden": "true" },
    svg("path", { d: PATHS[name] }));
}
