/** Screens that go on by themselves: something is said, nothing is asked. */
import { button, heading, html } from "../dom.ts";
import { icon, type IconName } from "../icons.ts";
import type { Screen } from "../messages.ts";
import { waiting } from "./parts.ts";
import type { Kiosk, MakeView, View } from "./view.ts";

function card(
  name: string, mark: IconName | HTMLElement, words: readonly string[], ...more: HTMLElement[]
): View {
  const [first = "", ...rest] = words.filter((text) => text !== "");
  const title = heading(first);
  const element = html("section", { class: `screen ended ${name}` },
    html("div", { class: "card" },
      typeof mark === "string" ? html("div", { class: "mark" }, icon(mark)) : mark,
      title, ...rest.map((text) => html("p", { class: "lead" }, text)), ...more));
  return { element, focus: title, spoken: [first, ...rest].join(" ") };
}

/** Until the hub has answered. */
export const deleting: MakeView = (_screen, { texts: { t } }) =>
  card("deleting", waiting(), [t("deleting.title"), t("deleting.text")]);

export const failed: MakeView = (screen, { texts }) => {
  const { why, hint } = screen.failed ?? { why: "failed", hint: null };
  return card("failed", "face", [
    texts.either(`failed.${why}`, "failed.failed"),
    hint === null ? "" : texts.either(`hint.${hint}`, "hint.other"),
    texts.t("failed.next"),
  ]);
};

export const busy: MakeView = (_screen, { texts: { t } }) =>
  card("busy", "people", [t("busy.title"), t("busy.text")]);

function fate({ thanks }: Screen, { texts }: Kiosk): readonly [IconName, string, string] {
  switch (thanks?.deleted) {
    case true: return ["check", texts.t("thanks.deleted"), texts.t("thanks.deleted_text")];
    case false: {
      const kept = thanks.retention_s === null ? texts.t("thanks.kept_until_deleted")
        : texts.t("thanks.kept", { duration: texts.duration(thanks.retention_s) });
      return ["check", texts.t("thanks.title"), kept];
    }
    default: return ["check", texts.t("thanks.title"), texts.t("thanks.nothing_taken")];
  }
}

export const thanks: MakeView = (screen, kiosk) => {
  const [mark, ...words] = fate(screen, kiosk);
  return card("thanks", mark, words, button({
    action: "done", label: kiosk.texts.t("thanks.done"), press: () => kiosk.say({ kind: "done" }),
  }));
};
