/** One picture of several: an item, the frame of it that is shown, and what is said meanwhile. */
import { html, set, write } from "../dom.ts";
import { FaceViewer } from "../viewer/viewer.ts";
import type { Item } from "./messages.ts";
import { look, type Looked } from "./server.ts";
import { busy, described, numbered, WORDS } from "./words.ts";

/** What takes less is not announced, ms. */
const PATIENCE_MS = 200;

/** Where one item is seen. */
export class ItemStage {
  readonly element: HTMLElement;
  readonly canvas = html("canvas", { tabindex: 0, role: "img" });
  readonly viewer: FaceViewer;
  /** What is shown. */
  looked: Looked | null = null;
  /** Told when another frame is shown, or cannot be. */
  onChange: () => void = () => undefined;
  readonly place: number;
  readonly item: Item;
  frame: number;
  private readonly caption = html("figcaption");
  private readonly state = html("p", { class: "state", role: "status" });
  /** The frame, where it became no face. */
  readonly picture = html("img", { class: "refused", hidden: true });
  private asked: AbortController | undefined;

  constructor(place: number, item: Item) {
    this.place = place;
    this.item = item;
    this.frame = item.first;
    this.element = html("figure", { class: "stage" },
      this.canvas, this.picture, this.state, this.caption);
    const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.viewer = new FaceViewer(this.canvas, { reducedMotion, free: true });
    new ResizeObserver(() => this.viewer.resize()).observe(this.canvas);
    this.label(item.name);
  }

  /** Shows a frame; a further one that is asked for meanwhile goes before. */
  async show(frame = this.frame): Promise<void> {
    this.asked?.abort();
    const asked = this.asked = new AbortController();
    this.frame = frame;
    set(this.element, { "aria-busy": "true" });
    const told = setTimeout(() => {
      write(this.state, busy(this.name(frame), this.item.kind === "frames"));
    }, PATIENCE_MS);
    try {
      const looked = await look(this.place, frame, asked.signal);
      if (asked.signal.aborted) return;
      const first = this.looked === null;
      this.looked = looked;
      await this.draw(looked, first);
    } catch (error) {
      if (asked.signal.aborted) return;
      this.looked = null;
      this.viewer.clear();
      set(this.picture, { hidden: true });
      write(this.state, error instanceof Error ? error.message : String(error));
    } finally {
      clearTimeout(told);
      if (!asked.signal.aborted) {
        set(this.element, { "aria-busy": undefined });
        this.onChange();
      }
    }
  }

  /** Gives everything back. */
  close(): void {
    this.asked?.abort();
    this.viewer.dispose();
    this.element.remove();
  }

  /** The name of a frame, for people. */
  name(frame = this.frame): string {
    return this.item.kind === "frames" && this.item.frames !== 1
      ? numbered(this.item.name, frame) : this.item.name;
  }

  private async draw({ seen, shape, picture }: Looked, first: boolean): Promise<void> {
    this.label(seen.title);
    set(this.picture, {
      src: picture ?? undefined, hidden: picture === null,
      alt: picture ? WORDS.refused : undefined,
    });
    set(this.canvas, { hidden: shape === null });
    if (shape === null) this.viewer.clear();
    else if (!this.viewer.rotatable && seen.shape === "mesh") {
      write(this.state, WORDS.noMesh);
      return;
    } else await this.viewer.show(shape, !first);
    write(this.state, seen.problem);
  }

  private label(title: string): void {
    write(this.caption, title);
    set(this.canvas, { "aria-label": described(title) });
  }
}
