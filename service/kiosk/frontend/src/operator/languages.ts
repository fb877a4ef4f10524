/** In which language an operator reads: the one chosen here before, else the browser's. */
import { type Texts, fetchTexts } from "../i18n.ts";

/** Those that come along, the first for browsers of other languages. */
export const LANGUAGES = ["en", "de", "fr", "es", "zh", "ar"] as const;

const KEPT = "denseface.operator.language";

/** The texts of an operator's language, and of the others by name. */
export interface Chosen {
  readonly texts: Texts;
  readonly all: ReadonlyMap<string, Texts>;
}

/** Fetches all languages and chooses one. */
export async function chooseTexts(): Promise<Chosen> {
  const all = await fetchTexts(LANGUAGES);
  const wanted = [kept(), ...navigator.languages.map((name) => name.split("-")[0] ?? "")];
  const name = wanted.find((each) => all.has(each)) ?? LANGUAGES[0];
  const texts = all.get(name) ?? [...all.values()][0];
  if (!texts) throw new Error("no language can be had");
  return { texts, all };
}

/** Keeps a choice for the next time, where the browser keeps anything. */
export function keepLanguage(name: string): void {
  try {
    localStorage.setItem(KEPT, name);
  } catch {
    // Then it is chosen anew.
  }
}

function kept(): string {
  try {
    return localStorage.getItem(KEPT) ?? "";
  } catch {
    return "";
  }
}
