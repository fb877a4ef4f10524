/** The page: what can be looked at, the pictures, what can be done with them and what is said of them. */
import { button, html, set, write } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { beforeAfter, modes, moves, turnByKey } from "../screens/tools.ts";
import type { Listing } from "./messages.ts";
import { keys, tell } from "./panel.ts";
import { fileName, picture, save } from "./saving.ts";
import { askListing, askTexts, stayOpen } from "./server.ts";
import { Stages } from "./stages.ts";
import { Stepper } from "./stepper.ts";
import { besideOthers, saved, WORDS } from "./words.ts";

const MODES: Readonly<Record<string, string>> = { 1: "mesh", 2: "points", 3: "sigma" };

/** One page, from its start until it is closed. */
export class ViewPage {
  private readonly root: HTMLElement;

  constructor(root: HTMLElement) {
    this.root = root;
  }

  /** Asks what there is to look at, and shows the first of it. */
  async start(): Promise<void> {
    try {
      const [texts, listing] = await Promise.all([askTexts(), askListing()]);
      if (listing.once) stayOpen();
      document.title = `${listing.items.map(({ name }) => name).join(", ")} – denseface`;
      await new Shown(this.root, texts, listing).start();
    } catch (error) {
      this.root.replaceChildren(html("main", {}, html("p", { class: "state", role: "alert" },
        error instanceof Error ? error.message : String(error))));
    }
  }
}

/** The page with all its parts. */
class Shown {
  private readonly texts: Texts;
  private readonly listing: Listing;
  private readonly stages: Stages;
  private readonly stepper = new Stepper();
  private readonly told = html("div", { class: "told" });
  private readonly title = html("h1");
  private readonly said = html("p", { class: "said", role: "status" });
  private readonly tools: HTMLElement;
  private readonly choices: readonly (readonly [HTMLButtonElement, HTMLButtonElement])[];

  constructor(root: HTMLElement, texts: Texts, listing: Listing) {
    this.texts = texts;
    this.listing = listing;
    this.stages = new Stages(listing.items);
    this.stages.onChange = () => this.changed();
    this.choices = listing.items.map(({ name }, place) => [
      button({
        action: `show-${place}`, label: name, look: "quiet", repeats: true,
        press: () => void this.stages.only(place),
      }),
      set(button({
        action: `beside-${place}`, label: besideOthers(name), icon: "beside",
        look: "tool", repeats: true, press: () => void this.stages.toggle(place),
      }), { title: WORDS.beside }),
    ]);
    this.tools = html("section", { class: "tools", "aria-label": WORDS.view },
      moves(this.stages, texts), beforeAfter(this.stages, texts), modes(this.stages, texts));
    const several = listing.items.length > 1;
    root.replaceChildren(
      html("header", {}, this.title, this.said, button({
        action: "save", label: WORDS.save, icon: "keep", look: "quiet", repeats: true,
        press: () => void this.save(),
      })),
      ...(several ? [html("nav", { "aria-label": WORDS.files }, html("ul", {},
        ...this.choices.map((both) => html("li", {}, ...both))))] : []),
      html("main", {}, this.stages.element, this.stepper.element),
      html("aside", { "aria-label": WORDS.about }, this.tools, this.told, keys(),
        html("p", { class: "made" }, `denseface ${listing.version}`)));
    set(root, { "data-several": several });
    document.addEventListener("keydown", (event) => this.key(event));
  }

  async start(): Promise<void> {
    await this.stages.only(0);
  }

  private changed(): void {
    const { active } = this.stages;
    write(this.title, active?.name() ?? "");
    this.stepper.of(active);
    this.choices.forEach(([alone, beside], place) => {
      set(alone, { "aria-pressed": String(this.stages.has(place)) });
      set(beside, { "aria-pressed": String(this.stages.has(place) && this.stages.all.length > 1) });
    });
    const seen = active?.looked?.seen;
    // A mesh has no initial cloud and no certainty; a frame without a face has nothing to turn.
    const shapes = this.stages.all.map((each) => each.looked?.seen.shape);
    set(this.tools, { "data-shape": shapes.includes("face") ? "face" : shapes.find(Boolean) ?? "none" });
    this.told.replaceChildren(...(seen ? tell(seen, this.texts) : []));
  }

  private async save(): Promise<void> {
    const { active } = this.stages;
    if (!active?.looked) return;
    try {
      const name = fileName(active.name());
      await save(picture(this.stages, this.texts.t("view.legend")), name);
      write(this.said, saved(name));
    } catch (error) {
      write(this.said, error instanceof Error ? error.message : String(error));
    }
  }

  private press(action: string): boolean {
    const found = this.tools.querySelector<HTMLElement>(`[data-action="${action}"]`);
    if (!found || found.offsetParent === null) return false;
    found.click();
    return true;
  }

  private key(event: KeyboardEvent): void {
    if (event.defaultPrevented || event.ctrlKey || event.altKey || event.metaKey) return;
    if (event.target instanceof Element && event.target.closest("input, pre") !== null) return;
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (this.did(key)) event.preventDefault();
  }

  private did(key: string): boolean {
    if (key in MODES) return this.press(MODES[key]!);
    switch (key) {
      case "b": return this.press(this.stages.viewer.blend > 0.5 ? "before" : "after");
      case "n": return this.stepper.step(1);
      case "p": return this.stepper.step(-1);
      case "s":
        void this.save();
        return true;
      default: return turnByKey(this.stages, key);
    }
  }
}
