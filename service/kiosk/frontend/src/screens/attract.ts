/** The first screen: a face that turns, one large button, the languages. */
import { button, heading, html } from "../dom.ts";
import { languagePicker, speechToggle } from "./parts.ts";
import type { MakeView } from "./view.ts";

export const attract: MakeView = (_screen, kiosk) => {
  const { texts: { t } } = kiosk;
  const spoken = `${t("attract.title")} ${t("attract.invitation")}`;
  const begin = button({
    action: "begin", label: t("attract.begin"), look: "main",
    press: () => kiosk.say({ kind: "begin" }),
  });
  const element = html("section", { class: "screen attract" },
    html("div", { class: "words" },
      heading(t("attract.title")),
      html("p", { class: "lead" }, t("attract.invitation")),
      begin),
    html("div", { class: "foot" }, languagePicker(kiosk), speechToggle(kiosk, () => spoken)));
  void kiosk.face.sample();
  return { element, focus: begin, spoken, close: () => kiosk.face.rest() };
};
