/** What is taken and how long it is kept: yes or no. */
import { button, heading, html } from "../dom.ts";
import { icon, type IconName } from "../icons.ts";
import type { Screen } from "../messages.ts";
import { languagePicker, speechToggle } from "./parts.ts";
import type { Kiosk, MakeView } from "./view.ts";

type Consent = NonNullable<Screen["consent"]>;

/** The page's own paragraphs; the operator's text takes their place. */
function builtIn(asked: Consent, { texts }: Kiosk): readonly (readonly [IconName, string])[] {
  const kept = asked.retention_s === null ? texts.t("consent.kept_until_deleted")
    : texts.t("consent.kept", { duration: texts.duration(asked.retention_s) });
  return [
    ["camera", texts.t("consent.taken")],
    ["clock", kept],
    ["face", texts.t("consent.use")],
    ["bin", texts.t("consent.delete")],
    ...(asked.links ? [["keep", texts.t("consent.links")] as const] : []),
  ];
}

function paragraphs(asked: Consent, kiosk: Kiosk): readonly HTMLElement[] {
  const text = asked.text;
  if (text === null) {
    return builtIn(asked, kiosk).map(([name, words]) =>
      html("p", { class: "point" }, icon(name), html("span", {}, words)));
  }
  const language = [kiosk.texts.language, ...kiosk.languages.map((each) => each.language)]
    .find((name) => name in text) ?? Object.keys(text)[0];
  return (language === undefined ? [] : text[language] ?? [])
    .map((words) => html("p", { lang: language, dir: "auto" }, words));
}

export const consent: MakeView = (screen, kiosk) => {
  const { texts: { t, language } } = kiosk;
  const asked = screen.consent ?? { retention_s: null, text_version: "", text: null, links: false };
  const title = heading(t("consent.title"));
  const said = paragraphs(asked, kiosk);
  const spoken = [title, ...said].map((each) => each.textContent).join(" ");
  const answer = (agreed: boolean): HTMLButtonElement => button({
    action: agreed ? "agree" : "refuse", label: t(agreed ? "consent.yes" : "consent.no"),
    press: () => kiosk.say({ kind: "consent", agreed, language }),
  });
  const element = html("section", { class: "screen consent" },
    html("div", { class: "card" },
      title,
      html("div", { class: "text", tabindex: 0 }, ...said),
      html("div", { class: "answers" }, answer(false), answer(true))),
    html("div", { class: "foot" }, languagePicker(kiosk), speechToggle(kiosk, () => spoken)));
  return { element, focus: title, spoken };
};
