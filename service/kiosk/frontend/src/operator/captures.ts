/** The last captures: what they look like, their reports, and their end. */
import { html } from "../dom.ts";
import { API, type Capture, ask, place } from "./api.ts";
import { type Desk, type Level, Rows, action, mark, moment, section } from "./parts.ts";

const LEVELS: Readonly<Record<string, Level>> = { done: "good", failed: "bad", dead: "bad" };
const STATES = new Set(["accepted", "working", "saving", "done", "failed", "dead"]);

const FEW = 10;
const MANY = 50;

/** The table of captures. */
export class Captures {
  readonly element: HTMLElement;
  private readonly desk: Desk;
  private readonly rows: Rows<Capture>;
  private readonly table: HTMLTableElement;
  private readonly none: HTMLElement;
  private readonly more: HTMLButtonElement;
  private all: readonly Capture[] = [];
  private last = FEW;
  private readonly removed = new Set<string>();

  constructor(desk: Desk) {
    this.desk = desk;
    const { t } = desk.texts;
    const body = html("tbody");
    this.table = html("table", {},
      html("thead", {}, html("tr", {}, ...["picture", "when", "state", "actions"].map((column) =>
        html("th", { scope: "col" }, t(`operator.captures.${column}`))))), body);
    this.rows = new Rows(body, (one) => this.row(one));
    this.none = html("p", { class: "none" }, t("operator.captures.none"));
    this.more = action("older", t("operator.captures.more"), () => {
      this.last = MANY;
      void this.desk.act(() => this.fetch(), "");
    });
    this.element = section("captures", t("operator.captures"), this.none, this.table, this.more);
  }

  /** Fetches the newest ones. */
  async fetch(): Promise<void> {
    this.all = await ask<readonly Capture[]>(`captures?last=${this.last}`);
    this.show();
  }

  private show(): void {
    const all = this.all.filter((one) => !this.removed.has(one.capture_id));
    this.none.hidden = all.length > 0;
    this.table.hidden = all.length === 0;
    this.more.hidden = this.last === MANY || this.all.length < this.last;
    this.rows.show(all, (one) => one.capture_id);
  }

  private row(one: Capture): HTMLElement {
    const { texts } = this.desk;
    const { t } = texts;
    const id = one.capture_id;
    const state = one.state.split(" ")[0] ?? "";
    const done = state === "done";
    const picture = done
      ? html("img", { src: `${API}/${place(id)}/thumbnail.png`, alt: "", loading: "lazy",
        width: 96, height: 96 })
      : html("span", { class: "no-picture" });
    return html("tr", {},
      html("td", { class: "picture" }, picture),
      html("th", { scope: "row" }, html("time", { datetime: one.accepted_at },
        moment(texts, one.accepted_at)), html("code", { class: "id" }, id)),
      html("td", {}, mark(LEVELS[state] ?? "waits",
        t(`operator.state.${STATES.has(state) ? state : "other"}`)),
      ...(one.error ? [html("code", {}, one.error)] : [])),
      html("td", { class: "actions" },
        ...(done ? [action("report", t("operator.captures.report"), () => void this.report(id),
          "plain", id)] : []),
        action("delete", t("operator.captures.delete"), () => void this.remove(id), "danger", id)));
  }

  private async report(id: string): Promise<void> {
    const { t } = this.desk.texts;
    await this.desk.act(async () => {
      const report = await ask<object>(`${place(id)}/report.json`);
      this.desk.show(t("operator.captures.report.title", { capture: id }),
        JSON.stringify(report, null, 2));
    }, "");
  }

  private async remove(id: string): Promise<void> {
    const { t } = this.desk.texts;
    if (!await this.desk.confirm({
      title: t("operator.captures.delete.title"),
      text: t("operator.captures.delete.text", { capture: id }), yes: t("operator.captures.delete"),
    })) return;
    await this.desk.act(async () => {
      await ask(`${place(id)}/delete`, "POST");
      this.removed.add(id);
      this.show();
    }, t("operator.captures.deleted"));
  }
}
