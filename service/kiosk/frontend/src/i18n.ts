/** Texts of a language: one flat JSON file each; numbers and durations as the language writes them. */

/** Texts by key; `language.name` and `language.direction` among them. */
export type Table = Readonly<Record<string, string>>;

/** What stands in a text's place holders; numbers are written as the language does. */
export type Values = Readonly<Record<string, string | number>>;

const MINUTE = 60;
const HOUR = 60 * MINUTE;
const DAY = 24 * HOUR;

/** Checks a language's file: texts by key. Throws a TypeError otherwise. */
export function readTable(value: unknown): Table {
  if (typeof value !== "object" || value === null || Array.isArray(value)) {
    throw new TypeError("a language's file is one JSON object");
  }
  const odd = Object.entries(value).find(([, text]) => typeof text !== "string");
  if (odd) throw new TypeError(`the text of ${odd[0]} is none`);
  return value as Table;
}

/** The texts of one language. */
export class Texts {
  /** Where lines begin. */
  readonly direction: "ltr" | "rtl";
  readonly language: string;
  private readonly table: Table;
  private readonly numbers: Intl.NumberFormat;

  constructor(language: string, table: Table) {
    this.language = language;
    this.table = table;
    this.direction = table["language.direction"] === "rtl" ? "rtl" : "ltr";
    this.numbers = new Intl.NumberFormat(language);
  }

  /** The language in its own words. */
  get name(): string {
    return this.table["language.name"] ?? this.language;
  }

  /** The text of a key; the key itself where there is none: seen, and caught by a test. */
  readonly t = (key: string, values: Values = {}): string =>
    (this.table[key] ?? key).replace(/\{(\w+)\}/g, (whole, name: string) => {
      const value = values[name];
      return value === undefined ? whole : typeof value === "number" ? this.number(value) : value;
    });

  /** The text of a key, or of another one where the first has none. */
  either(key: string, other: string): string {
    return this.t(key in this.table ? key : other);
  }

  number(value: number): string {
    return this.numbers.format(value);
  }

  /** A length, `digits` behind the point. */
  millimetres(value: number, digits: number): string {
    return new Intl.NumberFormat(this.language, {
      style: "unit", unit: "millimeter", unitDisplay: "short",
      minimumFractionDigits: digits, maximumFractionDigits: digits,
    }).format(value);
  }

  /** How long, in the one unit that fits. */
  duration(seconds: number): string {
    const [unit, of] = seconds < 2 * MINUTE ? ["second", 1] as const
      : seconds < 2 * HOUR ? ["minute", MINUTE] as const
      : seconds < 2 * DAY ? ["hour", HOUR] as const : ["day", DAY] as const;
    return new Intl.NumberFormat(this.language, {
      style: "unit", unit, unitDisplay: "long", maximumFractionDigits: 0,
    }).format(seconds / of);
  }
}

/** Fetches the texts of some languages, in their order; those that cannot be had are left out. */
export async function fetchTexts(languages: readonly string[]): Promise<Map<string, Texts>> {
  const fetched = await Promise.all(languages.map(async (language) => {
    try {
      const answer = await fetch(`/languages/${encodeURIComponent(language)}.json`);
      if (!answer.ok) throw new TypeError(`status ${answer.status}`);
      return new Texts(language, readTable(await answer.json()));
    } catch (error) {
      console.warn(`no texts of ${language}`, error);
      return undefined;
    }
  }));
  return new Map(fetched.filter((each) => each !== undefined).map((each) => [each.language, each]));
}
