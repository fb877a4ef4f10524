/** The pictures beside each other: they turn, come nearer and change together. */
import { html, set } from "../dom.ts";
import type { Shows } from "../screens/tools.ts";
import type { Mode } from "../viewer/viewer.ts";
import type { Item } from "./messages.ts";
import { ItemStage } from "./stage.ts";

/** Pictures at a time: browsers have few graphics contexts, and screens little room. */
export const MOST = 4;

/** All pictures that are shown. */
export class Stages implements Shows {
  readonly element = html("div", { class: "stages" });
  /** What tools work on: all of them. */
  readonly viewer: Shows["viewer"];
  /** Told when what is shown, or of which the panel tells, is another. */
  onChange: () => void = () => undefined;
  private readonly items: readonly Item[];
  private readonly shown: ItemStage[] = [];
  private chosen: ItemStage | undefined;
  private mode: Mode = "mesh";
  private blend = 1;

  constructor(items: readonly Item[]) {
    this.items = items;
    const stages = this;
    this.viewer = {
      rotate: (dx, dy) => stages.first?.viewer.rotate(dx, dy),
      zoom: (factor) => stages.first?.viewer.zoom(factor),
      reset: () => stages.first?.viewer.reset(),
      get mode() { return stages.mode; },
      set mode(mode) {
        stages.mode = mode;
        for (const each of stages.shown) each.viewer.mode = mode;
      },
      get blend() { return stages.blend; },
      set blend(blend) {
        stages.blend = blend;
        for (const each of stages.shown) each.viewer.blend = blend;
      },
    };
  }

  /** Of which the panel tells. */
  get active(): ItemStage | undefined {
    return this.chosen;
  }

  get all(): readonly ItemStage[] {
    return this.shown;
  }

  /** Whether an item is shown. */
  has(place: number): boolean {
    return this.shown.some((each) => each.place === place);
  }

  /** Shows an item alone. */
  async only(place: number): Promise<void> {
    for (const each of [...this.shown]) if (each.place !== place) this.remove(each);
    this.changed();
    await this.add(place);
  }

  /** Shows an item beside the others, or not; one is always there. */
  async toggle(place: number): Promise<void> {
    const there = this.shown.find((each) => each.place === place);
    if (!there) await this.add(place);
    else if (this.shown.length > 1) {
      this.remove(there);
      this.changed();
    }
  }

  /** The one whose view the others follow. */
  private get first(): ItemStage | undefined {
    return this.chosen?.looked?.shape ? this.chosen : this.shown.find((each) => each.looked?.shape);
  }

  private async add(place: number): Promise<void> {
    const there = this.shown.find((each) => each.place === place);
    const item = this.items[place];
    if (there || !item) {
      if (there) this.choose(there);
      return;
    }
    const oldest = this.shown[0];
    if (oldest && this.shown.length === MOST) this.remove(oldest);
    const stage = new ItemStage(place, item);
    stage.viewer.mode = this.mode;
    stage.viewer.blend = this.blend;
    stage.viewer.onView = (view) => {
      for (const each of this.shown) if (each !== stage) each.viewer.look(view);
    };
    stage.onChange = () => this.changed();
    for (const event of ["pointerdown", "focusin"]) {
      stage.element.addEventListener(event, () => this.choose(stage));
    }
    this.shown.push(stage);
    this.element.append(stage.element);
    this.choose(stage);
    await stage.show();
  }

  private remove(stage: ItemStage): void {
    this.shown.splice(this.shown.indexOf(stage), 1);
    stage.close();
    if (this.chosen === stage) this.chosen = this.shown[0];
  }

  private choose(stage: ItemStage): void {
    if (this.chosen === stage) return;
    this.chosen = stage;
    this.changed();
  }

  private changed(): void {
    set(this.element, { "data-count": this.shown.length });
    for (const each of this.shown) {
      set(each.element, { "data-active": each === this.chosen && this.shown.length > 1 });
    }
    this.onChange();
  }
}
