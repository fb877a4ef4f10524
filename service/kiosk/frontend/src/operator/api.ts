/** What the page asks of the kiosk: `/operator/api`. */

/** A sensor as the hub's status has it. */
export interface Sensor {
  readonly name: string;
  readonly state: string;
  readonly reason: string;
  readonly identity: string;
  readonly figures: { readonly frames: number; readonly drops: number; readonly reconnects: number };
}

/** The parts of the hub's status that are shown. */
export interface Status {
  readonly hub_version: string;
  readonly state: string;
  readonly files_read: number;
  readonly files_to_read: number;
  readonly sensor_states: readonly Sensor[];
  readonly workers: readonly string[];
  readonly queued: number;
  readonly working: number;
  readonly free_bytes: number | null;
  readonly kept_bytes: number | null;
  readonly retention_s?: number | null;
}

/** What is set at the kiosk. */
export interface Settings {
  readonly version: string;
  readonly consent: boolean;
  readonly links: string | null;
  readonly links_tls: boolean;
  readonly reserve_bytes: number;
}

/** Why people wait, and what becomes of visits, since the kiosk was started. */
export interface Statistics {
  readonly seconds: Readonly<Record<string, number>>;
  readonly visits: number;
  readonly captures: number;
  readonly faces: number;
  readonly kept: number;
  readonly ends: Readonly<Record<string, number>>;
  readonly positioning_s: number;
  /** From exposure to first mesh, the median, ms; missing before there is one. */
  readonly exposure_to_drawn_p50_ms?: number;
}

/** All that changes by itself. */
export interface Overview {
  readonly kiosk: Settings;
  readonly statistics: Statistics;
  /** Null while the hub does not answer. */
  readonly status: Status | null;
}

/** A capture in the list. */
export interface Capture {
  readonly capture_id: string;
  readonly state: string;
  readonly accepted_at: string;
  /** Null where there is a face, or none yet. */
  readonly error: string | null;
}

/** A capture that was given up. */
export interface DeadLetter {
  readonly capture_id: string;
  readonly error: string;
  readonly message: string;
  readonly attempts: number;
  readonly finished_at: string;
}

/** Where everything is asked. */
export const API = "/operator/api";

/** The kiosk says no, by a name; the words are under operator.error. */
export class Refused extends Error {
  readonly reason: string;
  readonly values: Readonly<Record<string, string | number>>;

  constructor(reason: string, values: Readonly<Record<string, string | number>> = {}) {
    super(reason);
    this.reason = reason;
    this.values = values;
  }
}

/** Asks for something; with a body, or by `POST`, has something done. Throws {@link Refused}. */
export async function ask<T>(path: string, method: "GET" | "POST" = "GET", body?: object): Promise<T> {
  const headers: Record<string, string> = body ? { "content-type": "application/json" } : {};
  let answer: Response;
  try {
    answer = await fetch(`${API}/${path}`, {
      method, headers, body: body ? JSON.stringify(body) : null, cache: "no-store",
      signal: AbortSignal.timeout(60_000),
    });
  } catch {
    throw new Refused("offline");
  }
  const said: unknown = await answer.json().catch(() => ({}));
  if (answer.ok) return said as T;
  const { error, ...values } = said as { error?: string } & Record<string, string | number>;
  throw new Refused(error ?? "other", { message: String(answer.status), ...values });
}

/** A capture's place in the API. */
export function place(capture: string): string {
  return `captures/${encodeURIComponent(capture)}`;
}
