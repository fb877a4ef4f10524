/** What several screens have. */
import { button, html, set, write } from "../dom.ts";
import { icon } from "../icons.ts";
import type { Kiosk } from "./view.ts";

/** How long a note is shown, ms. */
const NOTE_MS = 7000;

/** Every language by its own name. */
export function languagePicker(kiosk: Kiosk): HTMLElement {
  const { texts } = kiosk;
  const buttons = kiosk.languages.map((language) => set(button({
    action: `language-${language.language}`, label: language.name, look: "quiet",
    press: () => kiosk.choose(language.language),
  }), {
    lang: language.language, dir: language.direction,
    "aria-pressed": String(language.language === texts.language),
  }));
  return html("div", { class: "languages", role: "group", "aria-label": texts.t("language.choose") },
    ...(buttons.length > 1 ? buttons : []));
}

/** Reading aloud: a button, and what it says where there is no voice. */
export function speechToggle(kiosk: Kiosk, spoken: () => string): HTMLElement {
  const { texts, speech } = kiosk;
  if (!kiosk.mayspeak) return html("div", { class: "speech" });
  const note = html("p", { class: "note", role: "status" });
  const toggle = button({
    action: "speech", label: texts.t("speech.read_aloud"), icon: "speaker", look: "quiet",
    press: () => {
      const wanted = !speech.on;
      if (!speech.turn(wanted)) {
        write(note, texts.t("speech.no_voice"));
        setTimeout(() => write(note, ""), NOTE_MS);
      }
      show();
      speech.say(spoken());
    },
  });
  const show = (): void => {
    set(toggle, { "aria-pressed": String(speech.on) });
    toggle.firstElementChild?.replaceWith(icon(speech.on ? "speaker" : "silent"));
  };
  show();
  return html("div", { class: "speech" }, note, toggle);
}

/** The way back to the first screen. */
export function cancelButton(kiosk: Kiosk): HTMLButtonElement {
  return button({
    action: "cancel", label: kiosk.texts.t("cancel"), icon: "cross", look: "quiet",
    press: () => kiosk.say({ kind: "cancel" }),
  });
}

/** Dots that move while one waits. */
export function waiting(): HTMLElement {
  return html("div", { class: "waiting", "aria-hidden": "true" },
    html("i"), html("i"), html("i"));
}
