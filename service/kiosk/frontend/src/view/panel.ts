/** What is said of a picture: lengths, figures, where it comes from. */
import { html } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { lengths } from "../screens/measurements.ts";
import type { Fact, Seen } from "./messages.ts";
import { KEYS, WORDS } from "./words.ts";

function table(facts: readonly Fact[]): HTMLElement {
  return html("dl", {}, ...facts.map(({ name, value }) =>
    html("div", {}, html("dt", {}, name), html("dd", {}, value))));
}

function section(name: string, title: string, ...children: HTMLElement[]): HTMLElement {
  return html("section", { class: name, "aria-label": title }, html("h2", {}, title), ...children);
}

/** The sections of a panel; those of which there is nothing to say are left out. */
export function tell(seen: Seen, texts: Texts): HTMLElement[] {
  const sections: HTMLElement[] = [];
  if (seen.warnings.length) {
    sections.push(section("warnings", WORDS.warnings,
      html("ul", {}, ...seen.warnings.map((each) => html("li", {}, each)))));
  }
  if (seen.measurements.length) {
    sections.push(section("measured", WORDS.measurements, lengths(seen.measurements, texts)));
  }
  if (seen.figures.length) sections.push(section("figures", WORDS.figures, table(seen.figures)));
  if (seen.provenance.length) {
    sections.push(section("provenance", WORDS.provenance, table(seen.provenance)));
  }
  if (seen.report) {
    sections.push(html("details", { class: "report" }, html("summary", {}, WORDS.wholeReport),
      html("pre", { tabindex: 0, role: "region", "aria-label": WORDS.report }, seen.report)));
  }
  return sections;
}

/** What keys do. */
export function keys(): HTMLElement {
  return html("details", { class: "keys" }, html("summary", {}, WORDS.keys),
    html("dl", {}, ...KEYS.map(([key, what]) =>
      html("div", {}, html("dt", {}, ...key.split(" ").map((one) => html("kbd", {}, one))),
        html("dd", {}, what)))));
}
