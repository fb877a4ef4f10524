/** Why people wait, and what becomes of visits. */
import { html } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import type { Settings, Statistics, Status } from "./api.ts";
import { Rows, section } from "./parts.ts";

const GOOD = "good";

interface Bar {
  readonly code: string;
  readonly seconds: number;
  readonly share: number;
}

/** Bars, the longest first. */
export class Waiting {
  readonly element: HTMLElement;
  private readonly texts: Texts;
  private readonly bars: Rows<Bar>;
  private readonly none: HTMLElement;

  constructor(texts: Texts) {
    this.texts = texts;
    const list = html("ul", { class: "bars" });
    this.none = html("p", { class: "none" }, texts.t("operator.statistics.none"));
    this.element = section("waiting", texts.t("operator.statistics"),
      html("p", { class: "about" }, texts.t("operator.statistics.since")), this.none, list);
    this.bars = new Rows(list, (bar) => this.bar(bar));
  }

  /** Shows them. */
  show(statistics: Statistics): void {
    const all = Object.entries(statistics.seconds).filter(([, seconds]) => seconds > 0);
    const longest = Math.max(...all.map(([, seconds]) => seconds), 1);
    this.none.hidden = all.length > 0;
    this.bars.show(all.sort((a, b) => b[1] - a[1]).map(([code, seconds]) => (
      { code, seconds, share: seconds / longest })), (bar) => bar.code);
  }

  private bar({ code, seconds, share }: Bar): HTMLElement {
    const { t } = this.texts;
    const name = code === GOOD ? t("operator.statistics.good")
      : this.texts.either(`hint.${code}`, "hint.other");
    return html("li", { class: code === GOOD ? "bar good" : "bar" }, html("span", {}, name),
      html("meter", { min: 0, max: 1, value: share, "aria-hidden": "true" }),
      html("b", {}, t("operator.statistics.time", { seconds: Math.round(seconds) })));
  }
}

/** Pairs of a name and what it is. */
export class Facts {
  readonly element: HTMLElement;
  private readonly list: Rows<readonly [string, string]>;

  constructor(name: string, title: string) {
    const list = html("dl", { class: "facts" });
    this.element = section(name, title, list);
    this.list = new Rows(list, ([of, what]) =>
      html("div", {}, html("dt", {}, of), html("dd", {}, what)));
  }

  /** Shows them. */
  show(facts: readonly (readonly [string, string])[]): void {
    this.list.show(facts, ([of]) => of);
  }
}

/** What became of visits. */
export function visitFacts(texts: Texts, of: Statistics): (readonly [string, string])[] {
  const { t } = texts;
  const counts = ["visits", "captures", "faces", "kept"] as const;
  return [
    ...counts.map((name) => [t(`operator.visits.${name}`), texts.number(of[name])] as const),
    ...(of.captures ? [[t("operator.visits.average"), t("operator.statistics.time",
      { seconds: Math.round(of.positioning_s / of.captures) })] as const] : []),
    ...(of.exposure_to_drawn_p50_ms ? [[t("operator.visits.shown"), t("operator.statistics.time", {
      seconds: texts.number(Math.round(of.exposure_to_drawn_p50_ms / 100) / 10),
    })] as const] : []),
    ...Object.entries(of.ends).map(([end, count]) =>
      [texts.either(`operator.ends.${end}`, "operator.state.other"), texts.number(count)] as const),
  ];
}

/** What is set. */
export function settingFacts(
  texts: Texts, kiosk: Settings, status: Status | null,
): (readonly [string, string])[] {
  const { t } = texts;
  const kept = status?.retention_s;
  const retention: (readonly [string, string])[] = kept === undefined ? [] : [[
    t("operator.retention"),
    kept === null ? t("operator.retention.never") : texts.duration(kept)]];
  return [
    ...retention,
    ...(kiosk.consent ? [[t("operator.consent"), t("operator.consent.asked")] as const] : []),
    [t("operator.links"), kiosk.links === null ? t("operator.links.off")
      : t(kiosk.links_tls ? "operator.links.on" : "operator.links.plain",
        { address: kiosk.links })],
    [t("operator.version"), kiosk.version],
  ];
}
