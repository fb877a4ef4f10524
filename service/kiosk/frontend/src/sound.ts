/** The countdown's tick and the shutter: made, not loaded. */

/** Loudness of both, 0 to 1. */
const LOUDNESS = 0.15;

/** Sounds; none before `allow`. */
export class Sound {
  private context: AudioContext | undefined;
  private allowed = false;

  /** What the operator has set. */
  allow(allowed: boolean): void {
    this.allowed = allowed;
  }

  /** To be called while a touch is handled: a browser makes no sound before one. */
  wake(): void {
    if (!this.allowed || typeof AudioContext === "undefined") return;
    this.context ??= new AudioContext();
    void this.context.resume();
  }

  /** A second of the countdown. */
  tick(): void {
    this.beep(880, 0.07);
  }

  /** The frame is taken. */
  shutter(): void {
    this.beep(1320, 0.05);
    this.beep(660, 0.16, 0.06);
  }

  private beep(hertz: number, seconds: number, after = 0): void {
    const { context } = this;
    if (!this.allowed || context?.state !== "running") return;
    const begin = context.currentTime + after;
    const tone = new OscillatorNode(context, { type: "sine", frequency: hertz });
    const loudness = new GainNode(context, { gain: 0 });
    loudness.gain.setValueAtTime(LOUDNESS, begin);
    loudness.gain.exponentialRampToValueAtTime(0.001, begin + seconds);
    tone.connect(loudness).connect(context.destination);
    tone.start(begin);
    tone.stop(begin + seconds);
  }
}
