/** Lengths on the face, each with its interval. */
import { button, html, set } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import type { Measurement } from "../messages.ts";

/** Digits behind the point, mm. */
const DIGITS = 1;

function row(measured: Measurement, texts: Texts): HTMLElement {
  const values = {
    low: texts.millimetres(measured.low_mm, DIGITS), high: texts.millimetres(measured.high_mm, DIGITS),
  };
  return html("div", { class: "measured", "data-name": measured.name },
    html("dt", {}, texts.t(`measurement.${measured.name}`)),
    html("dd", {}, html("b", {}, texts.millimetres(measured.value_mm, DIGITS)),
      html("small", {}, texts.t("result.interval", values))));
}

/** A table of lengths. */
export function lengths(given: readonly Measurement[], texts: Texts): HTMLElement {
  return html("dl", {}, ...given.map((each) => row(each, texts)));
}

/** A panel over the face and the button that opens it. */
export function measurements(
  given: readonly Measurement[], texts: Texts,
): { readonly toggle: HTMLElement; readonly panel: HTMLElement; close(): boolean } {
  const panel = html("div", { class: "measurements", id: "measurements", hidden: true },
    html("h2", {}, texts.t("result.measurements")),
    lengths(given, texts));
  const open = (opened: boolean): void => {
    set(panel, { hidden: !opened });
    set(toggle, { "aria-expanded": String(opened) });
  };
  const toggle = set(button({
    action: "measurements", label: texts.t("result.measurements"), icon: "ruler", look: "quiet",
    repeats: true, press: () => open(panel.hidden !== false),
  }), { "aria-controls": "measurements" });
  open(false);
  return {
    toggle, panel,
    close: () => {
      const was = panel.hidden === false;
      open(false);
      return was;
    },
  };
}
