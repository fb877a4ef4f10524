/** What lies over any screen: something is gone; is anybody there? */
import { button, html, write } from "../dom.ts";
import { icon } from "../icons.ts";
import type { Screen, ScreenName, Trouble } from "../messages.ts";
import type { Kiosk } from "./view.ts";

/** Screens that lose nothing by what is gone: a line above them is enough. */
const GOES_ON: readonly ScreenName[] = ["result", "keep", "deleting", "thanks", "busy"];

/** The overlays, one of each at most. */
export class Overlays {
  readonly element = html("div", { class: "overlays" });
  private readonly alert = html("div", { class: "alerts", role: "alert" });
  private trouble = "";
  private leaving: HTMLElement | undefined;
  private seconds: HTMLElement | undefined;
  private before: Element | null = null;

  constructor() {
    this.element.append(this.alert);
  }

  /** Shows what is gone, `lost` for the server itself, and whether the visit is about to end. */
  update(screen: Screen | undefined, lost: boolean, kiosk: Kiosk): void {
    const gone = lost ? "page" : screen?.trouble ?? null;
    const wide = lost || screen === undefined || !GOES_ON.includes(screen.name);
    this.tell(gone, wide, kiosk);
    this.ask(lost ? null : screen?.leaving_s ?? null, kiosk);
  }

  private tell(gone: Trouble | "page" | null, wide: boolean, kiosk: Kiosk): void {
    const { t, language } = kiosk.texts;
    const now = gone === null ? "" : `${gone} ${wide} ${language}`;
    if (now === this.trouble) return;
    this.trouble = now;
    if (gone === null) {
      this.alert.replaceChildren();
      return;
    }
    const [first, then] = [t(`trouble.${gone}`), t(`trouble.${gone}_next`)];
    this.alert.replaceChildren(html("div", { class: wide ? "veil" : "banner", "data-trouble": gone },
      html("div", { class: wide ? "card" : "line" },
        html("div", { class: "mark" }, icon(gone === "sensor" ? "gone" : "clock")),
        html("div", {}, html("p", { class: "first" }, first), html("p", {}, then)))));
    kiosk.speech.say(`${first} ${then}`);
  }

  private ask(left: number | null, kiosk: Kiosk): void {
    const { texts } = kiosk;
    if (left === null) {
      if (!this.leaving) return;
      this.leaving.remove();
      this.leaving = undefined;
      if (this.before instanceof HTMLElement && this.before.isConnected) this.before.focus();
      return;
    }
    if (!this.leaving) {
      this.before = document.activeElement;
      this.seconds = html("p", { class: "seconds", "aria-hidden": "true" });
      const stay = button({
        action: "stay", label: texts.t("leaving.stay"), look: "main",
        press: () => kiosk.say({ kind: "touch" }),
      });
      this.leaving = html("div", { class: "veil" }, html("div", {
        class: "card", role: "alertdialog", "aria-modal": "true",
        "aria-labelledby": "leaving-title", "aria-describedby": "leaving-text",
      },
      html("h2", { id: "leaving-title" }, texts.t("leaving.title")), this.seconds,
      html("p", { id: "leaving-text" }, texts.t("leaving.text")), stay));
      this.element.append(this.leaving);
      stay.focus();
      kiosk.speech.say(texts.t("leaving.title"));
    }
    if (this.seconds) write(this.seconds, texts.number(Math.ceil(left)));
  }
}
