/** The mirror: one hint at a time, a ring that fills, the button. */
import { button, heading, html, set, write } from "../dom.ts";
import { icon, type IconName } from "../icons.ts";
import type { Screen } from "../messages.ts";
import { Outline } from "./outline.ts";
import { cancelButton, speechToggle } from "./parts.ts";
import type { Kiosk, MakeView } from "./view.ts";

type Position = NonNullable<Screen["position"]>;

const UNKNOWN: Position = {
  hint: null, arrow: null, progress: 0, can_press: false, with_warnings: false,
};

/** Pictures of hints that have no direction. */
const PICTURES: Readonly<Record<string, IconName>> = {
  one_person: "people", more_light: "light", less_light: "light", hold_still: "still",
};

function words(position: Position, { texts }: Kiosk): string {
  if (position.hint !== null) return texts.either(`hint.${position.hint}`, "hint.other");
  return texts.t(position.progress > 0 ? "position.well" : "position.look");
}

function picture(position: Position): IconName {
  if (position.arrow) return position.arrow;
  if (position.hint !== null) return PICTURES[position.hint] ?? "face";
  return position.progress > 0 ? "check" : "face";
}

export const position: MakeView = (screen, kiosk) => {
  const { texts: { t } } = kiosk;
  const outline = new Outline();
  const text = html("p", { class: "hint-text" });
  const note = html("p", { class: "press-note" });
  const hint = html("div", { class: "hint" }, html("div", {}, text, note));
  const press = button({
    action: "press", label: t("position.press"), icon: "camera", look: "main",
    press: () => kiosk.say({ kind: "press" }),
  });
  let said = "";
  let drawn = "";
  const update = ({ position: now }: Screen): void => {
    const shown = now ?? UNKNOWN;
    outline.fill(shown.progress);
    outline.point(shown.arrow);
    const name = picture(shown);
    if (name !== drawn) {
      drawn = name;
      hint.querySelector("svg")?.remove();
      hint.prepend(icon(name));
    }
    hint.classList.toggle("well", shown.hint === null && shown.progress > 0);
    const next = words(shown, kiosk);
    write(text, next);
    write(note, shown.with_warnings ? t("position.with_warnings") : "");
    set(press, { "aria-disabled": String(!shown.can_press) });
    if (next === said) return;
    said = next;
    kiosk.announce(next, "assertive");
  };
  update(screen);
  const title = heading(t("position.title"));
  title.className = "visually-hidden";
  const element = html("section", { class: "screen position" },
    title, outline.element,
    html("div", { class: "head" }, hint),
    html("div", { class: "bar" }, cancelButton(kiosk), press, speechToggle(kiosk, () => said)));
  return { element, focus: press, spoken: "", update };
};
