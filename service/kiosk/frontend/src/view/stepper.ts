/** Which frame of a recording is shown. */
import { button, html, set, write } from "../dom.ts";
import type { ItemStage } from "./stage.ts";
import { placed, WORDS } from "./words.ts";

/** Goes through the frames of one picture's recording. */
export class Stepper {
  readonly element: HTMLElement;
  private stage: ItemStage | undefined;
  private readonly slider = html("input", {
    type: "range", min: 0, step: 1, "aria-label": WORDS.frame, "data-action": "frame",
  });
  private readonly told = html("output", { class: "frame" });
  private readonly before = button({
    action: "previous", label: WORDS.previous, icon: "left", look: "tool", repeats: true,
    press: () => this.step(-1),
  });
  private readonly after = button({
    action: "next", label: WORDS.next, icon: "right", look: "tool", repeats: true,
    press: () => this.step(1),
  });

  constructor() {
    this.element = html("div", { class: "stepper", role: "group", "aria-label": WORDS.frames, hidden: true },
      this.before, this.slider, this.after, this.told);
    // A frame takes a moment: it is asked for where the slider is let go.
    this.slider.addEventListener("input", () => this.say(Number(this.slider.value)));
    this.slider.addEventListener("change", () => this.go(Number(this.slider.value)));
  }

  /** Takes the picture whose frames are gone through. */
  of(stage: ItemStage | undefined): void {
    this.stage = stage;
    const frames = stage?.item.frames ?? null;
    set(this.element, { hidden: stage?.item.kind !== "frames" || frames === 1 });
    if (!stage || this.element.hidden) return;
    set(this.slider, { max: (frames ?? 1) - 1, hidden: frames === null });
    this.slider.value = String(stage.frame);
    set(this.before, { "aria-disabled": String(stage.frame === 0) });
    set(this.after, { "aria-disabled": String(frames !== null && stage.frame >= frames - 1) });
    this.say(stage.frame);
  }

  /** Goes on, or back; gives whether there is such a frame. */
  step(by: number): boolean {
    return !this.element.hidden && this.stage !== undefined && this.go(this.stage.frame + by);
  }

  private go(frame: number): boolean {
    const { stage } = this;
    const frames = stage?.item.frames ?? Infinity;
    if (!stage || frame < 0 || frame >= frames || frame === stage.frame) return false;
    void stage.show(frame);
    this.of(stage);
    return true;
  }

  private say(frame: number): void {
    const text = placed(frame, this.stage?.item.frames ?? null);
    write(this.told, text);
    set(this.slider, { "aria-valuetext": text });
  }
}
