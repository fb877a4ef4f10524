/** Captures that were given up. */
import { html } from "../dom.ts";
import { type DeadLetter, ask } from "./api.ts";
import { type Desk, Rows, action, moment, section } from "./parts.ts";

/** The table of dead letters. */
export class DeadLetters {
  readonly element: HTMLElement;
  private readonly desk: Desk;
  private readonly rows: Rows<DeadLetter>;
  private readonly table: HTMLTableElement;
  private readonly none: HTMLElement;

  constructor(desk: Desk) {
    this.desk = desk;
    const { t } = desk.texts;
    const body = html("tbody");
    this.table = html("table", {}, html("thead", {}, html("tr", {},
      ...["operator.captures.when", "operator.dead.reason", "operator.captures.actions"].map((key) =>
        html("th", { scope: "col" }, t(key))))), body);
    this.rows = new Rows(body, (one) => this.row(one));
    this.none = html("p", { class: "none" }, t("operator.dead.none"));
    this.element = section("dead", t("operator.dead"),
      html("p", { class: "about" }, t("operator.dead.about")), this.none, this.table);
  }

  /** Fetches them. */
  async fetch(): Promise<void> {
    const letters = await ask<readonly DeadLetter[]>("dead");
    this.none.hidden = letters.length > 0;
    this.table.hidden = letters.length === 0;
    this.rows.show(letters, (one) => one.capture_id);
  }

  private row(one: DeadLetter): HTMLElement {
    const { t } = this.desk.texts;
    const id = one.capture_id;
    return html("tr", {},
      html("th", { scope: "row" }, html("time", { datetime: one.finished_at },
        moment(this.desk.texts, one.finished_at)), html("code", { class: "id" }, id)),
      html("td", {}, html("code", {}, one.error), html("p", { class: "reason" }, one.message)),
      html("td", { class: "actions" },
        action("retry", t("operator.dead.retry"), () => void this.desk.act(
          () => ask(`dead/${encodeURIComponent(id)}/retry`, "POST"), t("operator.dead.retried")),
        "plain", id),
        action("drop", t("operator.dead.drop"), () => void this.drop(id), "danger", id)));
  }

  private async drop(id: string): Promise<void> {
    const { t } = this.desk.texts;
    if (await this.desk.confirm({
      title: t("operator.dead.drop.title"), text: t("operator.dead.drop.text"),
      yes: t("operator.dead.drop") })) {
      await this.desk.act(() => ask(`dead/${encodeURIComponent(id)}/drop`, "POST"),
        t("operator.dead.dropped"));
    }
  }
}
