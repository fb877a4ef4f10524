/** What the sections are made of. */
import { html } from "../dom.ts";
import type { Texts } from "../i18n.ts";
import { Refused } from "./api.ts";

const GIGABYTE = 1e9;
const MEGABYTE = 1e6;

/** What a section needs of the page. */
export interface Desk {
  readonly texts: Texts;
  /** Does something and says how it went; the page is fetched anew after it. */
  readonly act: (work: () => Promise<unknown>, done: string) => Promise<void>;
  /** Asks whether something may be done that cannot be undone. */
  readonly confirm: (question: Question) => Promise<boolean>;
  /** Shows a text that is not of the page. */
  readonly show: (title: string, text: string) => void;
}

/** A question before something is done. */
export interface Question {
  readonly title: string;
  readonly text: string;
  readonly yes: string;
}

/** How well something is. */
export type Level = "good" | "waits" | "bad";

/** A section with its heading. */
export function section(name: string, title: string, ...children: Node[]): HTMLElement {
  const id = `${name}-title`;
  return html("section", { class: `card ${name}`, "aria-labelledby": id },
    html("h2", { id }, title), ...children);
}

/** A button; a dangerous one looks so. */
export function action(
  name: string, label: string, press: () => void, look: "plain" | "danger" = "plain", of = "",
): HTMLButtonElement {
  const made = html("button", { type: "button", class: look, "data-action": name,
    "aria-label": of ? `${label}: ${of}` : undefined }, label);
  made.addEventListener("click", press);
  return made;
}

/** A word with a mark whose shape differs too, for whoever sees no colours. */
export function mark(level: Level, text: string): HTMLElement {
  return html("span", { class: `mark ${level}` }, text);
}

/** A number of bytes in a unit that fits. */
export function bytes(texts: Texts, count: number): string {
  const [unit, of] = count >= GIGABYTE ? ["gigabyte", GIGABYTE] as const
    : ["megabyte", MEGABYTE] as const;
  return new Intl.NumberFormat(texts.language, {
    style: "unit", unit, unitDisplay: "short", maximumFractionDigits: count >= 10 * of ? 0 : 1,
  }).format(count / of);
}

/** A time of the day, with its date where it is another day. */
export function moment(texts: Texts, said: string): string {
  const at = new Date(said);
  if (Number.isNaN(at.getTime())) return said;
  const today = at.toDateString() === new Date().toDateString();
  return new Intl.DateTimeFormat(texts.language, {
    timeStyle: "medium", ...(today ? {} : { dateStyle: "medium" }),
  }).format(at);
}

/** What went wrong, in words. */
export function words(texts: Texts, error: unknown): string {
  const refused = error instanceof Refused ? error : new Refused("other", { message: String(error) });
  const key = `operator.error.${refused.reason}`;
  const text = texts.t(key, refused.values);
  return text === key ? texts.t("operator.error.other", { message: refused.reason }) : text;
}

/** Puts rows into a place, keeping those that are as before: what has the focus keeps it. */
export class Rows<T> {
  private readonly made = new Map<string, { readonly as: string; readonly row: HTMLElement }>();
  private readonly into: HTMLElement;
  private readonly make: (one: T) => HTMLElement;

  constructor(into: HTMLElement, make: (one: T) => HTMLElement) {
    this.into = into;
    this.make = make;
  }

  /** Shows these, by their names. */
  show(all: readonly T[], name: (one: T) => string): void {
    const rows = all.map((one) => {
      const key = name(one);
      const as = JSON.stringify(one);
      const before = this.made.get(key);
      if (before?.as === as) return before.row;
      const row = this.make(one);
      this.made.set(key, { as, row });
      return row;
    });
    const names = new Set(all.map(name));
    for (const key of [...this.made.keys()]) if (!names.has(key)) this.made.delete(key);
    const same = rows.length === this.into.childElementCount
      && rows.every((row, index) => this.into.children[index] === row);
    if (!same) this.into.replaceChildren(...rows);
  }
}
