/** The QR code to fetch a face by. */
import { button, html, svg } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import type { KeepScreen } from "../messages.ts";

/** White modules around a QR code, as its standard asks for. */
const QUIET = 4;

/** The path of a QR code's black modules: one bar for each run in a row. */
export function qrPath(rows: readonly string[]): string {
  return rows.map((row, y) => [...row.matchAll(/1+/g)]
    .map((run) => `M${run.index + QUIET} ${y + QUIET}h${run[0].length}v1h-${run[0].length}z`)
    .join("")).join("");
}

function code(keep: KeepScreen, label: string): HTMLElement {
  const size = keep.qr.length + 2 * QUIET;
  return html("div", { class: "qr", role: "img", "aria-label": label },
    svg("svg", { viewBox: `0 0 ${size} ${size}`, "shape-rendering": "crispEdges" },
      svg("path", { d: qrPath(keep.qr) })));
}

/** The sheet over the result: `back` leads to the face again, `done` to the end. */
export function keepSheet(
  keep: KeepScreen, texts: Texts, back: () => void, done: () => void,
): HTMLElement {
  const { t } = texts;
  const title = html("h2", { id: "keep-title", tabindex: -1 }, t("keep.title"));
  const formats = keep.links.map(({ format }) =>
    html("li", {}, texts.either(`keep.format_${format}`, "keep.format_other")));
  return html("div", { class: "sheet", role: "dialog", "aria-labelledby": "keep-title" },
    code(keep, t("keep.qr")),
    html("div", { class: "text" },
      title,
      html("p", {}, t("keep.scan")),
      html("ul", {}, ...formats),
      html("p", { class: "small" },
        t("keep.limits", { duration: texts.duration(keep.expires_s), uses: keep.uses })),
      html("p", { class: "small address", dir: "ltr" }, keep.page),
      html("div", { class: "answers" },
        button({ action: "back", label: t("keep.back"), icon: "face", press: back }),
        button({ action: "keep-done", label: t("result.done"), icon: "check", look: "main", press: done }))));
}
