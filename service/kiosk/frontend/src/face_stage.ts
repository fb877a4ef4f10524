/** The one canvas of faces: the sample of the first screen, then the visitor's own. */

/** Ways to see a face. */
export type Mode = "mesh" | "points" | "sigma";

/** Draws a face. */
export interface Viewer {
  show(face: unknown): Promise<void>;
  mode: Mode;
  blend: number;
  turning: boolean;
  readonly sigmaRange: readonly [number, number];
  rotate(dx: number, dy: number): void;
  zoom(factor: number): void;
  reset(): void;
  resize(): void;
}

const SAMPLE = "/static/sample.face";

/** Shows one face at a time. */
export class FaceStage {
  /** Whose face is drawn: a capture's id, `SAMPLE`, or none. */
  shown: string | undefined;
  /** Told when a capture's face is drawn for the first time. */
  onDrawn: (captureId: string) => void = () => {};
  viewer: Viewer | undefined;
  private wanted: string | undefined;

  readonly canvas: HTMLCanvasElement;

  constructor(canvas: HTMLCanvasElement) {
    this.canvas = canvas;
  }

  async sample(): Promise<void> {
    await this.show(SAMPLE, async () => {
      const answer = await fetch(SAMPLE);
      return new Uint8Array(await answer.arrayBuffer());
    });
  }

  async take(captureId: string, grid: Uint8Array<ArrayBuffer>): Promise<void> {
    await this.show(captureId, async () => grid.slice());
    if (this.shown === captureId) this.onDrawn(captureId);
  }

  /** Nothing is to be seen: nothing is drawn. */
  rest(): void {
    if (this.viewer) this.viewer.turning = false;
  }

  private async show(name: string, bytes: () => Promise<Uint8Array<ArrayBuffer>>): Promise<void> {
    if (this.wanted === name) return;
    this.wanted = name;
    await bytes();
    if (this.wanted === name) this.shown = name;
  }
}
