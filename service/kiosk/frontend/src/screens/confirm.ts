/** A question before what cannot be undone. */
import { button, html } from "../dom.ts";
import type { Texts } from "../i18n.ts";

/** "Delete now?" over the result. */
export function confirmDelete(texts: Texts, yes: () => void, no: () => void): HTMLElement {
  const { t } = texts;
  return html("div", { class: "veil" },
    html("div", {
      class: "card", role: "alertdialog", "aria-modal": "true", "aria-labelledby": "confirm-title",
      "aria-describedby": "confirm-text",
    },
    html("h2", { id: "confirm-title", tabindex: -1 }, t("delete.title")),
    html("p", { id: "confirm-text" }, t("delete.text")),
    html("div", { class: "answers" },
      button({ action: "delete-no", label: t("delete.no"), press: no }),
      button({ action: "delete-yes", label: t("delete.yes"), icon: "bin", press: yes }))));
}
