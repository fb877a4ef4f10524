/** The WebSocket to the server: comes back by itself, checks what comes, says what is to be said. */
import {
  FACE, type FaceHead, type FromPage, type Hello, type MirrorHead, readBinary, readText,
  type Screen,
} from "./messages.ts";

/** Time before the first and the longest time before any other attempt to connect, ms. */
const FIRST_WAIT_MS = 250;
const LONGEST_WAIT_MS = 2000;

/** What a `Socket` tells of. */
export interface Heard {
  hello(hello: Hello): void;
  screen(screen: Screen): void;
  mirror(head: MirrorHead, jpeg: Uint8Array<ArrayBuffer>): void;
  face(head: FaceHead, grid: Uint8Array<ArrayBuffer>): void;
  /** The server is gone. Told once; the next `hello` says that it is back. */
  gone(): void;
  /** The server is of another version than this page. */
  outdated(): void;
}

/** What a `Socket` needs of the browser. */
export interface Surroundings {
  open(url: string): WebSocket;
  later(call: () => void, ms: number): void;
  complain(text: string, error: unknown): void;
}

const BROWSER: Surroundings = {
  open: (url) => new WebSocket(url),
  later: (call, ms) => void setTimeout(call, ms),
  complain: (text, error) => console.warn(text, error),
};

/** One connection after the other, until the page is closed. */
export class Socket {
  private readonly url: string;
  private readonly heard: Heard;
  private readonly browser: Surroundings;
  private socket: WebSocket | undefined;
  private wait = FIRST_WAIT_MS;
  private version: string | undefined;
  private isGone = false;

  constructor(url: string, heard: Heard, browser: Surroundings = BROWSER) {
    this.url = url;
    this.heard = heard;
    this.browser = browser;
  }

  /** Connects, and again whenever the connection is lost. */
  connect(): void {
    const socket = this.browser.open(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onmessage = (event: MessageEvent<unknown>) => {
      if (socket === this.socket) this.take(event.data);
    };
    socket.onclose = () => {
      if (socket === this.socket) this.lost();
    };
  }

  /** Says something; gives whether there was anybody to say it to. */
  say(said: FromPage): boolean {
    if (this.socket?.readyState !== 1) return false;
    this.socket.send(JSON.stringify(said));
    return true;
  }

  private lost(): void {
    this.socket = undefined;
    if (!this.isGone) {
      this.isGone = true;
      this.heard.gone();
    }
    this.browser.later(() => this.connect(), this.wait);
    this.wait = Math.min(2 * this.wait, LONGEST_WAIT_MS);
  }

  private take(data: unknown): void {
    try {
      if (typeof data === "string") this.takeText(data);
      else if (data instanceof ArrayBuffer) this.takeBinary(data);
    } catch (error) {
      this.browser.complain("a message of the server is left out", error);
    }
  }

  private takeText(data: string): void {
    const said = readText(data);
    if (said.kind === "screen") {
      this.heard.screen(said);
      return;
    }
    this.wait = FIRST_WAIT_MS;
    this.isGone = false;
    if (this.version !== undefined && this.version !== said.version) {
      this.heard.outdated();
      return;
    }
    this.version = said.version;
    this.heard.hello(said);
  }

  private takeBinary(data: ArrayBuffer): void {
    const said = readBinary(data);
    if (said.kind === FACE) this.heard.face(said.head, said.payload);
    else this.heard.mirror(said.head, said.payload);
  }
}
