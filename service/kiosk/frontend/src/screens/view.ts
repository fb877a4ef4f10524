/** What a screen is to the page. */
import type { FaceStage } from "../face_stage.ts";
import type { Texts } from "../i18n.ts";
import type { Said, Screen } from "../messages.ts";
import type { Sound } from "../sound.ts";
import type { Speech } from "../speech.ts";

/** What a screen may use. */
export interface Kiosk {
  readonly texts: Texts;
  /** Every language there is, in the operator's order. */
  readonly languages: readonly Texts[];
  readonly speech: Speech;
  /** Whether hints may be spoken. */
  readonly mayspeak: boolean;
  readonly sound: Sound;
  readonly face: FaceStage;
  /** Says something to the server, of the visit that is shown. */
  say(said: Said): void;
  /** Takes another language. */
  choose(language: string): void;
  /** Has a text read out: by a screen reader and, where it was asked for, aloud. */
  announce(text: string, urgency: "polite" | "assertive"): void;
}

/** One screen while it is shown. */
export interface View {
  readonly element: HTMLElement;
  /** What takes the focus when the screen comes. */
  readonly focus: HTMLElement;
  /** What is read aloud when the screen comes. */
  readonly spoken: string;
  /** The same screen with other contents: nothing is made anew that did not change. */
  update?(screen: Screen): void;
  /** Escape: gives whether that was all; otherwise the visit is cancelled. */
  escape?(): boolean;
  /** An arrow key or another one that a screen knows: gives whether it did something. */
  key?(key: string): boolean;
  close?(): void;
}

/** Makes a screen. */
export type MakeView = (screen: Screen, kiosk: Kiosk) => View;
