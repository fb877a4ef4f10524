/** The face: looked at from all sides, then kept or deleted. */
import { button, heading, html, set, write } from "../dom.ts";
import type { Screen } from "../messages.ts";
import { confirmDelete } from "./confirm.ts";
import { keepSheet } from "./keep.ts";
import { measurements } from "./measurements.ts";
import { waiting } from "./parts.ts";
import { beforeAfter, modes, moves, turnByKey } from "./tools.ts";
import type { Kiosk, MakeView } from "./view.ts";

function actions(kiosk: Kiosk, can_keep: boolean, remove: () => void, keep: () => void): HTMLElement {
  const { texts: { t } } = kiosk;
  return html("div", { class: "bar" },
    button({ action: "delete", label: t("result.delete"), icon: "bin", press: remove }),
    button({
      action: "again", label: t("result.again"), icon: "again",
      press: () => kiosk.say({ kind: "again" }),
    }),
    ...(can_keep ? [button({ action: "keep", label: t("result.keep"), icon: "keep", press: keep })] : []),
    button({
      action: "done", label: t("result.done"), icon: "check", look: "main",
      press: () => kiosk.say({ kind: "done" }),
    }));
}

function facts(screen: Screen, { texts }: Kiosk): HTMLElement {
  const { initial_points = 0, dense_points = 0, warnings = [] } = screen.result ?? {};
  const [first] = warnings;
  return html("div", { class: "facts" },
    ...(dense_points > 0 ? [html("p", {}, texts.t("result.points", {
      initial: initial_points, dense: dense_points,
    }))] : []),
    ...(first === undefined ? [] : [html("p", { class: "small" }, texts.t("result.next_time", {
      hint: texts.either(`hint.${first}`, "hint.other"),
    }))]));
}

export const result: MakeView = (screen, kiosk) => {
  const { texts, texts: { t }, face } = kiosk;
  const title = heading(t("result.title"));
  const measured = screen.result?.measurements?.length
    ? measurements(screen.result.measurements, texts) : undefined;
  let now = screen;
  let over: HTMLElement | undefined;
  let sheeted: Screen["keep"] = null;
  const show = (next?: HTMLElement): void => {
    over?.remove();
    over = next;
    set(front, { inert: next !== undefined });
    if (next) element.append(next);
    (next?.querySelector<HTMLElement>("[tabindex]") ?? title).focus();
  };
  const sheet = (): void => {
    sheeted = now.keep;
    if (now.keep) show(keepSheet(now.keep, texts, () => show(), () => kiosk.say({ kind: "done" })));
  };
  const remove = (): void => show(confirmDelete(texts, () => kiosk.say({ kind: "delete" }), () => show()));
  const keep = (): void => now.keep ? sheet() : void kiosk.say({ kind: "keep" });
  const unseen = html("p");
  const unlinked = html("p", { class: "small", role: "status" });
  const front = html("div", { class: "front" },
    html("div", { class: "unseen" }, waiting(), unseen),
    html("div", { class: "tools" },
      html("div", { class: "head" }, title, facts(screen, kiosk), unlinked),
      ...(face.viewer.rotatable ? [moves(face, texts)]
        : [html("p", { class: "small" }, t("view.flat"))]),
      beforeAfter(face, texts), modes(face, texts),
      ...(measured ? [measured.toggle] : [])),
    ...(measured ? [measured.panel] : []),
    actions(kiosk, screen.result?.can_keep ?? false, remove, keep));
  const element = html("section", { class: "screen result" }, front);
  const update = (next: Screen): void => {
    now = next;
    write(unseen, t(face.failed === screen.result?.capture_id ? "result.no_view" : "result.unseen"));
    write(unlinked, next.result?.no_links ? t("result.no_links") : "");
    if (next.name === "keep" && next.keep && next.keep.page !== sheeted?.page) sheet();
  };
  update(screen);
  return {
    element, focus: title, spoken: t("result.title"), update,
    escape: () => {
      if (over) show();
      else measured?.close();
      return true;
    },
    key: (key) => over === undefined && turnByKey(face, key),
    close: () => face.rest(),
  };
};
