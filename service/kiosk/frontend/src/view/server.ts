/** What is asked of the server. All addresses are below the page's own, which is secret. */
import { decodeFaceGrid } from "../face_grid.ts";
import { readTable, Texts } from "../i18n.ts";
import { decodeMesh } from "../viewer/mesh.ts";
import type { Shape } from "../viewer/viewer.ts";
import { type Listing, readListing, readSeen, type Seen } from "./messages.ts";
import { WORDS } from "./words.ts";

/** The server is gone, or refuses; the message says it to the one who looks. */
export class ServerError extends Error {
  override readonly name = "ServerError";
}

/** What is to be said and shown of one frame. */
export interface Looked {
  readonly seen: Seen;
  readonly shape: Shape | null;
  /** Where a picture of a frame without a face is. */
  readonly picture: string | null;
}

async function ask(path: string, signal?: AbortSignal): Promise<Response> {
  let answer: Response;
  try {
    answer = await fetch(path, signal ? { signal } : {});
  } catch (error) {
    if (signal?.aborted) throw error;
    throw new ServerError(WORDS.ended);
  }
  if (!answer.ok) throw new ServerError((await answer.text()).trim() || `status ${answer.status}`);
  return answer;
}

/** The words of buttons and measurements. */
export async function askTexts(): Promise<Texts> {
  return new Texts("en", readTable(await (await ask("texts.json")).json()));
}

/** What can be looked at. */
export async function askListing(): Promise<Listing> {
  return readListing(await (await ask("items.json")).json());
}

/** One frame of an item, counted from 0 as the items are. */
export async function look(item: number, frame: number, signal: AbortSignal): Promise<Looked> {
  const place = `items/${item}/${frame}`;
  const seen = readSeen(await (await ask(`${place}/seen.json`, signal)).json());
  const picture = seen.picture ? `${place}/picture.png` : null;
  if (seen.shape === "none") return { seen, shape: null, picture };
  const bytes = new Uint8Array(await (await ask(`${place}/shape.bin`, signal)).arrayBuffer());
  return {
    seen, picture, shape: seen.shape === "face" ? await decodeFaceGrid(bytes) : decodeMesh(bytes),
  };
}

/** Says that this page is open, for as long as it is. */
export function stayOpen(): void {
  const address = new URL("open", location.href);
  address.protocol = "ws:";
  new WebSocket(address);
}
