/** The face's outline over the mirror: a ring that fills, and where to go. */
import { html, set, svg } from "../dom.ts";
import { icon } from "../icons.ts";
import type { Arrow } from "../messages.ts";

/** A head, on a field of 300 x 400. */
const HEAD = "M150 8c78 0 132 60 132 158 0 122-70 226-132 226S18 288 18 166C18 68 72 8 150 8z";

/** The outline while it is shown. */
export class Outline {
  readonly element: HTMLElement;
  private readonly ring = svg("path", { class: "ring", d: HEAD, pathLength: 100 });
  private arrow: Arrow | null = null;

  constructor() {
    this.element = html("div", { class: "outline", "aria-hidden": "true" },
      svg("svg", { viewBox: "0 0 300 400" }, svg("path", { class: "track", d: HEAD }), this.ring));
    this.fill(0);
  }

  /** Fills a part of the ring, 0 to 1. */
  fill(part: number): void {
    set(this.ring, { "stroke-dasharray": `${Math.round(100 * part)} 101` });
    this.element.classList.toggle("filling", part > 0);
  }

  /** Points to where to go: to that side of the mirror, in every language. */
  point(arrow: Arrow | null): void {
    if (arrow === this.arrow) return;
    this.arrow = arrow;
    this.element.querySelector(".arrow")?.remove();
    set(this.element, { "data-arrow": arrow ?? undefined });
    if (arrow && arrow !== "closer" && arrow !== "back") {
      this.element.append(html("div", { class: `arrow ${arrow}` }, icon(arrow)));
    }
  }
}
