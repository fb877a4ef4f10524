/** The one canvas of faces: the sample of the first screen, then the visitor's own. */
import { decodeFaceGrid, type FaceGrid } from "./face_grid.ts";
import { FaceViewer } from "./viewer/viewer.ts";

const SAMPLE = "/static/sample.face";

/** Shows one face at a time, by one viewer for as long as the page lives. */
export class FaceStage {
  /** Whose face is drawn: a capture's id, or none. */
  shown: string | undefined;
  /** Whose face cannot be shown. */
  failed: string | undefined;
  /** Told when a face is drawn for the first time, or cannot be. */
  onChange: (name: string) => void = () => {};
  readonly viewer: FaceViewer;
  private wanted: string | undefined;
  private readonly samples: Promise<FaceGrid>[] = [];

  constructor(canvas: HTMLCanvasElement) {
    const reducedMotion = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.viewer = new FaceViewer(canvas, { reducedMotion });
    new ResizeObserver(() => this.viewer.resize()).observe(canvas);
  }

  /** Shows the sample. */
  async sample(): Promise<void> {
    await this.show(SAMPLE, () => {
      const [loaded = loadSample()] = this.samples;
      this.samples[0] = loaded;
      return loaded.catch((error: unknown) => {
        this.samples.pop();
        throw error;
      });
    });
  }

  /** Shows a capture's face. */
  async take(captureId: string, grid: Uint8Array<ArrayBuffer>): Promise<void> {
    await this.show(captureId, () => decodeFaceGrid(grid));
  }

  /** Whether a screen's face is drawn: that of a capture, or the sample. */
  seen(captureId: string | undefined): boolean {
    return this.shown === (captureId ?? SAMPLE);
  }

  /** Nothing is to be seen: nothing moves. */
  rest(): void {
    this.viewer.turning = false;
  }

  /** Lets go of a visitor's face: nothing of it stays in the page. */
  forget(): void {
    if (this.wanted === undefined || this.wanted === SAMPLE) return;
    this.wanted = this.shown = undefined;
    this.viewer.turning = false;
    this.viewer.clear();
  }

  private async show(name: string, load: () => Promise<FaceGrid>): Promise<void> {
    if (this.wanted === name && this.failed !== name) {
      if (this.shown === name) this.begin();
      return;
    }
    this.wanted = name;
    this.failed = undefined;
    try {
      const face = await load();
      if (this.wanted !== name) return;
      this.begin();
      if (!await this.viewer.show(face) || this.wanted !== name) return;
      this.shown = name;
    } catch (error) {
      console.warn("a face cannot be shown", error);
      if (this.wanted === name) this.failed = name;
    }
    this.onChange(name);
  }

  private begin(): void {
    this.viewer.mode = "mesh";
    this.viewer.blend = 1;
    this.viewer.turning = true;
  }
}

async function loadSample(): Promise<FaceGrid> {
  const answer = await fetch(SAMPLE);
  if (!answer.ok) throw new TypeError(`${SAMPLE}: status ${answer.status}`);
  return decodeFaceGrid(new Uint8Array(await answer.arrayBuffer()));
}
