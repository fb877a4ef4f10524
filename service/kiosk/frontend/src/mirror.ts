/** The mirror by pull: a picture is drawn, then the next one is asked for. */
import type { MirrorHead } from "./messages.ts";

/** Time without an answer after which a picture is asked for again, ms. */
const PATIENCE_MS = 3000;

/** Draws the pictures, left and right exchanged; the last one stays. */
export class Mirror {
  private readonly canvas: HTMLCanvasElement;
  private readonly ask: () => void;
  private on = false;
  private undrawn = false;
  private timer: ReturnType<typeof setTimeout> | undefined;

  constructor(canvas: HTMLCanvasElement, ask: () => void) {
    this.canvas = canvas;
    this.ask = ask;
  }

  /** Asks for pictures from now on. */
  start(): void {
    if (this.on) return;
    this.on = true;
    this.next();
  }

  /** Asks for none any more; what is under way is not drawn. */
  stop(): void {
    this.on = false;
    clearTimeout(this.timer);
  }

  /** The server is back: what was asked for before will not come. */
  restart(): void {
    if (this.on) this.next();
  }

  /** Forgets the last picture. */
  clear(): void {
    this.stop();
    this.canvas.getContext("2d")?.clearRect(0, 0, this.canvas.width, this.canvas.height);
    delete this.canvas.dataset["timestamp"];
  }

  /** Draws a picture and asks for the next; one that comes while another is undrawn is left out. */
  async take(head: MirrorHead, jpeg: Uint8Array<ArrayBuffer>): Promise<void> {
    if (!this.on || this.undrawn) return;
    this.undrawn = true;
    try {
      const picture = await createImageBitmap(new Blob([jpeg], { type: "image/jpeg" }));
      if (this.on) this.draw(picture, head);
      picture.close();
    } catch (error) {
      console.warn("a picture of the mirror is left out", error);
    } finally {
      this.undrawn = false;
    }
    if (this.on) this.next();
  }

  private draw(picture: ImageBitmap, head: MirrorHead): void {
    const { canvas } = this;
    if (canvas.width !== picture.width || canvas.height !== picture.height) {
      canvas.width = picture.width;
      canvas.height = picture.height;
      canvas.toggleAttribute("data-upright", picture.height > picture.width);
    }
    const context = canvas.getContext("2d", { alpha: false });
    context?.setTransform(-1, 0, 0, 1, picture.width, 0);
    context?.drawImage(picture, 0, 0);
    canvas.dataset["timestamp"] = String(head.timestamp_us);
  }

  private next(): void {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => this.next(), PATIENCE_MS);
    this.ask();
  }
}
