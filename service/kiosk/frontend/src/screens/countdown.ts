/** Three, two, one: over the mirror, without a flash. */
import { heading, html, write } from "../dom.ts";
import type { Screen } from "../messages.ts";
import { Outline } from "./outline.ts";
import { cancelButton } from "./parts.ts";
import type { MakeView } from "./view.ts";

export const countdown: MakeView = (screen, kiosk) => {
  const { texts } = kiosk;
  const title = heading(texts.t("countdown.title"));
  const digits = html("p", { class: "digits", "aria-hidden": "true" });
  const outline = new Outline();
  outline.fill(1);
  let shown: number | undefined;
  const update = ({ countdown: now }: Screen): void => {
    const left = now?.left ?? 0;
    if (left === shown) return;
    shown = left;
    const text = left > 0 ? texts.number(left) : "";
    write(digits, text);
    // An animation begins anew with another class.
    digits.className = `digits ${left % 2 ? "odd" : "even"}`;
    if (left > 0) {
      kiosk.sound.tick();
      kiosk.announce(text, "assertive");
    }
  };
  update(screen);
  const element = html("section", { class: "screen countdown" },
    outline.element, html("div", { class: "head" }, title), digits,
    html("div", { class: "bar" }, cancelButton(kiosk)));
  return { element, focus: title, spoken: "", update };
};
