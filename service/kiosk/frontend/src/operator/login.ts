/** The way in. */
import { html, write } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { ask } from "./api.ts";
import { words } from "./parts.ts";

const COMMAND = "denseface kiosk --new-operator-token";

/** The form for the token; `entered` is called once it was the right one. */
export function login(texts: Texts, entered: () => void, said = ""): HTMLElement {
  const { t } = texts;
  const field = html("input", { id: "token", name: "token", type: "password", required: true,
    autocomplete: "current-password", autocapitalize: "none", spellcheck: "false", dir: "ltr",
    "aria-describedby": "wrong" });
  const wrong = html("p", { id: "wrong", class: "wrong", role: "alert" }, said);
  const enter = html("button", { type: "submit", class: "main" }, t("operator.login.enter"));
  const [before = "", after = ""] = t("operator.login.lost", { command: "\n" }).split("\n");
  // For the browser's own keeper of passwords, which wants a name beside each.
  const user = html("input", { type: "text", name: "username", autocomplete: "username",
    value: "operator", hidden: true });
  const form = html("form", { class: "login" }, user, html("h1", {}, t("operator.login.title")),
    html("p", {}, t("operator.login.text")),
    html("label", { for: "token" }, t("operator.login.token")), field, wrong, enter,
    html("p", { class: "about" }, before, html("code", { dir: "ltr" }, COMMAND), after));
  form.addEventListener("submit", (event) => {
    event.preventDefault();
    enter.disabled = true;
    write(wrong, "");
    ask("login", "POST", { token: field.value }).then(entered, (error: unknown) => {
      write(wrong, words(texts, error));
      field.select();
      field.focus();
    }).finally(() => { enter.disabled = false; });
  });
  requestAnimationFrame(() => field.focus());
  return form;
}
