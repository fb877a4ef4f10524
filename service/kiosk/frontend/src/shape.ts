/** Checks of what comes from outside: each gives the value in its type, or says what is wrong. */

/** A check: the value, known fields alone; throws a TypeError that names the place. */
export type Check<T> = (value: unknown, where: string) => T;

/** What a check gives. */
export type Checked<C> = C extends Check<infer T> ? T : never;

function wrong(where: string, wanted: string): never {
  throw new TypeError(`${where}: ${wanted} expected`);
}

export const text: Check<string> = (value, where) =>
  typeof value === "string" ? value : wrong(where, "text");

export const flag: Check<boolean> = (value, where) =>
  typeof value === "boolean" ? value : wrong(where, "true or false");

export const real: Check<number> = (value, where) =>
  typeof value === "number" && Number.isFinite(value) ? value : wrong(where, "a number");

/** A whole number that is not negative. */
export const count: Check<number> = (value, where) =>
  Number.isSafeInteger(value) && (value as number) >= 0 ? (value as number)
    : wrong(where, "a whole number");

/** One of some words. */
export function oneOf<const W extends string>(...words: readonly W[]): Check<W> {
  return (value, where) => words.includes(value as W) ? (value as W)
    : wrong(where, words.join(" | "));
}

/** The value or null, as a missing field is read too. */
export function orNull<T>(check: Check<T>): Check<T | null> {
  return (value, where) => value === null || value === undefined ? null : check(value, where);
}

/** A field that may be missing. */
export function or<T>(check: Check<T>, missing: T): Check<T> {
  return (value, where) => value === undefined ? missing : check(value, where);
}

export function list<T>(check: Check<T>): Check<readonly T[]> {
  return (value, where) => Array.isArray(value)
    ? value.map((each, i) => check(each, `${where}[${i}]`)) : wrong(where, "a list");
}

/** An object of any names. */
export function table<T>(check: Check<T>): Check<Readonly<Record<string, T>>> {
  return (value, where) => {
    if (typeof value !== "object" || value === null || Array.isArray(value)) {
      return wrong(where, "an object");
    }
    return Object.fromEntries(
      Object.entries(value).map(([name, each]) => [name, check(each, `${where}.${name}`)]));
  };
}

/** An object of these names; others, of a newer server, are left out. */
export function fields<F extends Record<string, Check<unknown>>>(
  checks: F,
): Check<{ readonly [N in keyof F]: Checked<F[N]> }> {
  return (value, where) => {
    if (typeof value !== "object" || value === null || Array.isArray(value)) {
      return wrong(where, "an object");
    }
    const said = value as Record<string, unknown>;
    return Object.fromEntries(Object.entries(checks).map(
      ([name, check]) => [name, check(said[name], `${where}.${name}`)],
    )) as { [N in keyof F]: Checked<F[N]> };
  };
}
