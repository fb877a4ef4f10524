/** From the frame to the face: the last picture of the mirror stays. */
import { heading, html } from "../dom.ts";
import { icon } from "../icons.ts";
import { cancelButton, waiting } from "./parts.ts";
import type { Kiosk, MakeView, View } from "./view.ts";

function over(name: string, text: string, mark: HTMLElement | SVGElement, kiosk: Kiosk): View {
  const title = heading(text);
  const element = html("section", { class: `screen ${name}` },
    html("div", { class: "scan", "aria-hidden": "true" }),
    html("div", { class: "head" }, html("div", { class: "hint well" }, mark, title)),
    html("div", { class: "bar" }, cancelButton(kiosk)));
  return { element, focus: title, spoken: text };
}

/** The frame is taken: told after it, never by a flash. */
export const captured: MakeView = (_screen, kiosk) => {
  kiosk.sound.shutter();
  return over("captured", kiosk.texts.t("captured.title"), icon("check"), kiosk);
};

export const reconstructing: MakeView = (_screen, kiosk) =>
  over("reconstructing", kiosk.texts.t("reconstructing.title"), waiting(), kiosk);
