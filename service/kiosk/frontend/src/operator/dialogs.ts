/** Questions before what cannot be undone, and texts to read. */
import { html } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { type Question, action } from "./parts.ts";

/** Asks; false where it is closed without an answer. */
export function confirm(texts: Texts, question: Question): Promise<boolean> {
  return new Promise((answer) => {
    const dialog = html("dialog", { "aria-labelledby": "question", "aria-describedby": "consequence" });
    const end = (yes: boolean): void => {
      answer(yes);
      dialog.close();
    };
    dialog.append(html("h2", { id: "question" }, question.title),
      html("p", { id: "consequence" }, question.text),
      html("div", { class: "actions" },
        action("cancel", texts.t("operator.confirm.cancel"), () => end(false)),
        action("confirm", question.yes, () => end(true), "danger")));
    open(dialog, () => answer(false));
  });
}

/** Shows a text. */
export function show(texts: Texts, title: string, text: string): void {
  const dialog = html("dialog", { class: "reading", "aria-labelledby": "reading" });
  dialog.append(html("h2", { id: "reading" }, title),
    html("pre", { tabindex: 0, role: "region", "aria-labelledby": "reading", dir: "ltr" }, text),
    html("div", { class: "actions" },
      action("close", texts.t("operator.close"), () => dialog.close())));
  open(dialog, () => undefined);
}

function open(dialog: HTMLDialogElement, closed: () => void): void {
  const before = document.activeElement;
  dialog.addEventListener("close", () => {
    dialog.remove();
    if (before instanceof HTMLElement && before.isConnected) before.focus();
    closed();
  });
  document.body.append(dialog);
  dialog.showModal();
}
